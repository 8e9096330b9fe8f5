#include "smartmill_kalman/compensation/force_model_chooser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/testing/force_block.h"
#include "smartmill_core/testing/reference_case.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"

namespace smartmill::kalman {
namespace {

using ::testing::StartsWith;
using Speed = ForceModelChoice::Speed;
using Reason = ForceModelChoice::Reason;

constexpr double SPEED = 900.0;       // [rad/s]
constexpr double START = 1.75e9;      // [s]
constexpr double READING = 0.01;      // [s] between two readings
constexpr double GOLDEN = 0.3819660;  // [1] cycles between two readings: their phases are spread evenly

/// Speed of the spindle over time since the start.
using Profile = std::function<double(double)>;

Profile sine(double rms, double cycles = GOLDEN) {
  return [=](double t) {
    return SPEED * (1.0 + std::sqrt(2.0) * rms * std::sin(units::TWO_PI * cycles * t / READING + 0.3));
  };
}

/// Reading number i of a profile.
SpindleAngle reading(const Profile& profile, int i) {
  const double t = READING * i;
  return {START + t, 0.0, profile(t)};
}

// The readings of a sine have its RMS. A window has 21 of them, whose phases are spread evenly: within a
// tenth.
TEST(SpeedRipple, IsTheRmsOfASine) {
  for (const double rms : {0.001, 0.005, 0.02}) {
    for (const double drift : {0.0, 0.005}) {  // [1/s], removed by the line
      SpeedRipple ripple(0.002);
      const Profile profile = sine(rms);
      for (int i = 0; i < 300; ++i) {
        ripple.add(reading([&](double t) { return profile(t) * (1.0 + drift * t); }, i));
        if (i < 45) continue;  // two windows
        ASSERT_TRUE(ripple.isRippling()) << rms << " " << i;
        ASSERT_NEAR(ripple.rms(), rms, 0.1 * rms) << i;
        if (drift > 0.0) continue;
        ASSERT_NEAR(ripple.speed(), SPEED, 0.3 * rms * SPEED);
      }
    }
  }
}

// A sine changes by 2 sqrt(2) of its RMS: by 0.17 % with 0.06 %.
TEST(SpeedRipple, WithinTheToleranceIsNone) {
  SpeedRipple ripple(0.002);
  for (int i = 0; i < 300; ++i) {
    ripple.add(reading(sine(0.0006), i));
    ASSERT_FALSE(ripple.isRippling());
  }
}

TEST(SpeedRipple, ARunUpIsNone) {
  const auto from = [](double t, double begin) { return std::max(0.0, t - begin); };
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 1e-4);
  for (const double begin : {1.0, 1.03, 1.07, 1.11, 1.16}) {  // anywhere in a window
    for (const Profile& profile : std::vector<Profile>{
             [&](double t) { return SPEED * (1.0 - 0.8 * std::min(1.0, from(t, begin))); },
             [&](double t) { return SPEED * (1.0 - 0.02 * std::min(1.0, from(t, begin) / 0.5)); },
             [&](double t) { return SPEED * (0.3 + 0.7 * std::exp(-from(t, begin) / 0.3)); },
             [&](double t) { return SPEED * (0.3 + 0.7 * std::exp(-from(t, begin) / 0.05)); },
             [&](double t) {
               return SPEED * (1.0 - 0.4 * (1.0 - std::cos(units::PI * std::min(1.0, from(t, begin)))));
             }}) {
      SpeedRipple ripple(0.002);
      for (int i = 0; i < 300; ++i) {
        SpindleAngle angle = reading(profile, i);
        angle.speed *= 1.0 + noise(random);
        ripple.add(angle);
        ASSERT_FALSE(ripple.isRippling()) << begin << " " << i;
      }
    }
  }
}

TEST(SpeedRipple, EndsWithTheRippleAndAtOnceWithTheSpeed) {
  SpeedRipple ripple(0.002);
  for (int i = 0; i < 100; ++i) ripple.add(reading(sine(0.005), i));
  ASSERT_TRUE(ripple.isRippling());
  SpeedRipple stopped = ripple, other = ripple;
  stopped.add({START + 1.0, 0.0, 0.0});
  EXPECT_FALSE(stopped.isRippling());
  other.add({START + 1.0, 0.0, 0.9 * SPEED});
  EXPECT_FALSE(other.isRippling());
  for (int i = 100; i < 145; ++i) ripple.add({START + READING * i, 0.0, SPEED});
  EXPECT_FALSE(ripple.isRippling());
}

TEST(SpeedRipple, OneReadingAndRestAreNone) {
  SpeedRipple ripple(0.002);
  EXPECT_FALSE(ripple.isRippling());
  ripple.add({START, 0.0, SPEED});
  EXPECT_FALSE(ripple.isRippling());
  for (int i = 1; i < 200; ++i) ripple.add({START + READING * i, 0.0, 0.0});
  EXPECT_FALSE(ripple.isRippling());
}

class Chooser : public testing::Test {
 protected:
  void SetUp() override { condition_.spindle_speed = 1.01 * SPEED; }
  void begin(const CompensationParameters& parameters = {}) {
    chooser = std::make_unique<ForceModelChooser>(parameters);
    chooser->handle(condition_);
  }
  /// Blocks every 10 ms until a time since the start, each after its reading. @return choice of the last
  ForceModelChoice run(double until, const Profile& profile = nullptr) {
    ForceModelChoice choice;
    for (; READING * next_ < until; ++next_) {
      if (profile) chooser->handle(reading(profile, next_));
      choice = chooser->choose(START + READING * next_);
    }
    return choice;
  }
  CncState controller(double t, double speed) const {
    CncState state;
    state.stamp = START + t;
    state.connected = true;
    state.spindle_speed = speed;
    return state;
  }

  std::unique_ptr<ForceModelChooser> chooser;
  CuttingCondition condition_;
  int next_ = 0;
};

const Profile STEADY = [](double) { return SPEED; };

TEST_F(Chooser, MeasuresTheSpeedWhereItCan) {
  begin();
  EXPECT_EQ(run(5.0, STEADY).speed, Speed::measured);
  EXPECT_EQ(chooser->text(), "harmonics by spindle angle");
  EXPECT_TRUE(chooser->hasDefault());
}

TEST_F(Chooser, EstimatesTheSpeedAfterTheLastReading) {
  begin();
  run(2.005, STEADY);  // last reading at 2.0 s
  EXPECT_EQ(run(2.595).speed, Speed::measured);
  EXPECT_EQ(run(2.615).speed, Speed::estimated);
  EXPECT_EQ(run(2.805).speed, Speed::estimated);
  EXPECT_EQ(chooser->text(), "harmonics, speed estimated (no spindle angle for 0.8 s)");
  EXPECT_EQ(chooser->startSpeed(), 1.01 * SPEED);
}

TEST_F(Chooser, EstimatesTheSpeedWithoutAnyReading) {
  begin();
  EXPECT_EQ(run(0.595).speed, Speed::measured);  // there may be one yet; at speed 0 samples pass through
  EXPECT_EQ(run(0.615).speed, Speed::estimated);
  EXPECT_EQ(chooser->text(), "harmonics, speed estimated (no spindle angle)");
}

TEST_F(Chooser, UsesReadingsThatReturnWhenTheyKeepComing) {
  begin();
  run(1.005, STEADY);
  run(3.0);
  EXPECT_EQ(run(3.595, STEADY).speed, Speed::estimated);
  EXPECT_EQ(run(3.615, STEADY).speed, Speed::measured);
  EXPECT_EQ(chooser->text(), "harmonics by spindle angle");
  // A single one is not enough.
  run(5.0);
  run(5.005, STEADY);
  EXPECT_EQ(run(5.595).speed, Speed::estimated);
  EXPECT_EQ(run(6.5).speed, Speed::estimated);
}

TEST_F(Chooser, APauseOfAllStreamsIsNoMissingReading) {
  begin();
  run(1.0, STEADY);
  next_ = 500;
  EXPECT_EQ(chooser->choose(START + 5.0).speed, Speed::measured);  // the block comes before its reading
  EXPECT_EQ(run(5.5, STEADY).speed, Speed::measured);
}

TEST_F(Chooser, PrefersTheSpeedOfTheController) {
  begin();
  run(1.0);
  chooser->handle(controller(1.0, 0.98 * SPEED));
  EXPECT_EQ(run(1.1).speed, Speed::estimated);
  EXPECT_EQ(chooser->startSpeed(), 0.98 * SPEED);
  chooser->handle(controller(1.1, 0.0));
  EXPECT_EQ(run(1.2).speed, Speed::unknown);
  EXPECT_EQ(chooser->text(),
            "none, samples pass through (no spindle angle; spindle at rest by the controller)");
  EXPECT_EQ(run(2.0).speed, Speed::estimated);  // the controller is silent
  EXPECT_EQ(chooser->startSpeed(), 1.01 * SPEED);
  CncState lost = controller(2.0, SPEED);
  lost.connected = false;
  chooser->handle(lost);
  EXPECT_TRUE(std::isnan(chooser->controllerSpeed()));
}

TEST_F(Chooser, StatesThatNoSpeedIsKnown) {
  condition_.spindle_speed = 0.0;
  begin();
  EXPECT_EQ(run(1.0).speed, Speed::unknown);
  EXPECT_EQ(chooser->text(),
            "none, samples pass through (no spindle angle; no speed from controller or cutting condition)");
}

TEST_F(Chooser, NamesTheRipple) {
  begin();
  const ForceModelChoice choice = run(2.0, sine(0.007));
  EXPECT_EQ(choice.speed, Speed::estimated);
  EXPECT_NEAR(choice.value, 0.007, 0.0007);
  EXPECT_THAT(chooser->text(), StartsWith("harmonics, speed estimated (speed ripple 0."));
  EXPECT_NEAR(chooser->startSpeed(), SPEED, 0.002 * SPEED);
  EXPECT_EQ(run(3.0, STEADY).speed, Speed::measured);
}

TEST_F(Chooser, ReadingsThatAreNotNumbersAreMissing) {
  begin();
  EXPECT_EQ(run(1.0, [](double) { return NOT_A_NUMBER; }).reason, Reason::no_angle);
}

TEST_F(Chooser, KeepsASettingThatIsFixed) {
  CompensationParameters parameters;
  parameters.track_speed = false;
  begin(parameters);
  EXPECT_EQ(run(2.0).speed, Speed::measured);
  parameters.track_speed = true;
  next_ = 0;
  begin(parameters);
  EXPECT_EQ(run(2.0, STEADY).speed, Speed::estimated);
  EXPECT_EQ(chooser->text(), "harmonics, speed estimated (track_speed always)");
}

TEST_F(Chooser, DoesNotEstimateWhereTheAngleIsRequired) {
  CompensationParameters parameters;
  parameters.follow = true;
  begin(parameters);
  EXPECT_EQ(run(2.0, sine(0.007)).speed, Speed::measured);
  EXPECT_THAT(chooser->text(), StartsWith("harmonics by spindle angle (speed ripple 0."));
  EXPECT_EQ(run(3.0).speed, Speed::unknown);
  EXPECT_EQ(chooser->text(),
            "none, samples pass through (no spindle angle for 1.0 s; follow excludes an estimate)");
  parameters.follow = false;
  parameters.delay_form = true;
  next_ = 0;
  begin(parameters);
  EXPECT_EQ(run(2.0, STEADY).speed, Speed::measured);
  EXPECT_EQ(chooser->text(), "delay form by spindle angle");
  EXPECT_EQ(run(3.0).speed, Speed::unknown);
}

/// The reference cut through the pipeline.
struct Cut {
  explicit Cut(double rpm, double duration = 1.6) {
    reference.spindle_speed = units::radPerSecFromRpm(rpm);
    reference.duration = duration;
  }
  struct Result {
    std::array<std::vector<double>, 2> force;
    std::size_t before_flush = 0;  // blocks
    std::string model;
    CompensationHealth health;
  };
  /// @param angles_until, angles_from [s] no readings in between @param behind blocks by which the readings
  /// arrive late @param stopped [s] from which anglesStopped() is called
  Result run(const CompensationParameters& parameters, double angles_until, double angles_from = 1e9,
             std::size_t behind = 0, double stopped = 1e9) {
    if (record.time.empty()) record = simulate(reference);
    Result result;
    ForceSensor sensor;
    sensor.axis[0] = sensor.axis[1] = reference.sensor;
    sensor.axis[2].direct = 1.0;
    CompensationPipeline pipeline(parameters, {}, sensor, 0.05,
                                  {{{}, [&](const ForceBlock& block) {
                                      for (std::size_t axis = 0; axis < 2; ++axis) {
                                        result.force[axis].insert(result.force[axis].end(),
                                                                  block.force[axis].begin(),
                                                                  block.force[axis].end());
                                      }
                                    }}});
    CuttingCondition condition;
    condition.kind = CuttingCondition::Kind::cut;
    condition.spindle_speed = reference.spindle_speed * (1.0 + reference.nominal_off);
    pipeline.push(condition);
    constexpr std::size_t BLOCK = 256;
    const std::size_t blocks = record.time.size() / BLOCK;
    for (std::size_t b = 0; b < blocks + behind; ++b) {
      if (b < blocks) {
        SampleBlock block = forceBlock(record.time[b * BLOCK], reference.sample_rate, b * BLOCK);
        for (std::size_t i = b * BLOCK; i < (b + 1) * BLOCK; ++i)
          block.samples.insert(block.samples.end(), {record.measured[0][i], record.measured[1][i], 0.0});
        pipeline.push(block);
      }
      if (static_cast<double>(b * BLOCK) / reference.sample_rate >= stopped) pipeline.anglesStopped();
      if (b < behind) continue;
      const double t = record.time[(b - behind) * BLOCK];
      if (t <= angles_until || t >= angles_from)
        pipeline.push(SpindleAngle{t, std::fmod(reference.angleAt(t), units::TWO_PI), reference.speedAt(t)});
    }
    result.before_flush = result.force[0].size() / BLOCK;
    pipeline.flush();
    result.model = pipeline.forces().forceModel();
    result.health = pipeline.forces().health();
    return result;
  }
  /// Worst of x and y to 5 kHz over the last 0.3 s [1].
  double error(const Result& result) const {
    double worst = 0.0;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const std::vector<double>& force = result.force[axis];
      worst = std::max(worst, bandError(force, record.truth[axis], reference.sample_rate, force.size() - 7680,
                                        force.size(), 5000.0));
    }
    return worst;
  }
  ReferenceCase reference;
  ReferenceRecord record;
};

constexpr double ALWAYS = 1e9;  // [s]

TEST(ForceModel, WithAnAngleAndNoRippleNothingChanges) {
  Cut cut(9430.0, 1.0);
  CompensationParameters fixed;
  fixed.track_speed = false;
  const Cut::Result chosen = cut.run({}, ALWAYS), measured = cut.run(fixed, ALWAYS);
  EXPECT_EQ(chosen.force, measured.force);
  EXPECT_EQ(chosen.model, "harmonics by spindle angle");
  EXPECT_EQ(chosen.health.estimated_blocks, 0u);
  EXPECT_EQ(chosen.health.speed_std, 0.0);
}

// The commanded speed is 0.5 % off. The memory of two revolutions in place of eight doubles the noise of the
// amplitudes; a quarter more for the speed.
constexpr double LARGER = 2.5;  // [1]

TEST(ForceModel, WithoutTheAngleTheForceIsAsGood) {
  for (const double rpm : {9430.0, 21610.0}) {
    Cut cut(rpm);
    cut.reference.nominal_off = 0.005;
    const double with = cut.error(cut.run({}, ALWAYS));
    for (const double last : {-1.0, 0.4}) {  // never a reading; none after 0.4 s
      const Cut::Result without = cut.run({}, last);
      EXPECT_LT(cut.error(without), LARGER * with) << rpm << " " << last;
      EXPECT_LT(cut.error(without), 0.012) << rpm << " " << last;
      EXPECT_THAT(without.model, StartsWith("harmonics, speed estimated (no spindle angle"));
      EXPECT_GT(without.health.estimated_blocks, 50u);
      EXPECT_GT(without.health.speed_std, 0.0);
    }
    const Cut::Result returned = cut.run({}, 0.0, 0.65);
    EXPECT_LT(cut.error(returned), LARGER * with) << rpm;
    EXPECT_EQ(returned.model, "harmonics by spindle angle");
  }
}

// Readings that arrive 1 s late are awaited, whether they end or not, and a node that stops waiting for
// readings that do not come changes nothing: the forces are the same, every bit.
TEST(ForceModel, DependsOnStampsOnly) {
  Cut cut(9430.0);
  for (const double last : {ALWAYS, 0.4}) {
    const Cut::Result straight = cut.run({}, last), late = cut.run({}, last, 1e9, 100);
    EXPECT_EQ(straight.force, late.force) << last;
    EXPECT_EQ(straight.model, late.model);
    EXPECT_EQ(straight.health.estimated_blocks, late.health.estimated_blocks);
  }
  const Cut::Result straight = cut.run({}, 0.4), stopped = cut.run({}, 0.4, 1e9, 0, 0.8);
  EXPECT_EQ(straight.force, stopped.force);
  EXPECT_GT(stopped.before_flush, 140u);  // of 160 blocks; the last wait for events
  EXPECT_LT(straight.before_flush, 45u);
}

// At 0.5 % and order 4 the samples passed through before: the readings change by more than speed_tolerance.
TEST(ForceModel, FollowsARippleOfTheSpeed) {
  for (const double rpm : {9430.0, 21610.0}) {
    Cut cut(rpm);
    cut.reference.speed_ripple = 0.005;
    cut.reference.ripple_frequency = 4.0 * rpm / 60.0;
    CompensationParameters fixed;
    fixed.track_speed = false;
    const Cut::Result chosen = cut.run({}, ALWAYS);
    EXPECT_THAT(chosen.model, StartsWith("harmonics, speed estimated (speed ripple 0.")) << rpm;
    EXPECT_LT(cut.error(chosen), 0.012) << rpm;
    EXPECT_GT(cut.error(cut.run(fixed, ALWAYS)), 0.1) << rpm;
  }
}

}  // namespace
}  // namespace smartmill::kalman
