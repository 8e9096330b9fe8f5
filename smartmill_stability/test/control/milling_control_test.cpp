#include "smartmill_stability/control/milling_control.h"

#include <gtest/gtest.h>

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"
#include "smartmill_stability_testing/benchmark.h"

namespace smartmill::stability {
namespace {

constexpr double RPM = units::TWO_PI / 60.0;

/// Down-milling at half immersion with one mode in x and y.
RegenerativeSystem system() {
  return systemOf(readMachineModel(MODEL_FILE), 90.0, 180.0);
}

UncertainSystem estimated(double frequency = 0.005) {
  const RegenerativeSystem mean = system();
  return UncertainSystem(mean, std::vector<ModeUncertainty>(mean.modes.size(), {frequency, 0.05, 0.05}), 0.05,
                         0.1);
}

class Control : public ::testing::Test {
 protected:
  Control() { start(); }

  void start(bool known = true) {
    parameters_.adaptive = true;
    control_ = std::make_unique<MillingControl>(parameters_, 16,
                                                [known](const Engagement&) -> std::optional<UncertainSystem> {
                                                  if (known) return estimated();
                                                  return std::nullopt;
                                                });
    cut_.kind = CuttingCondition::Kind::cut;
    cut_.name = "slot";
    cut_.spindle_speed = 10000.0 * RPM;
    cut_.engagement = {units::PI / 2.0, units::PI, 1e-3, 0.1e-3};
    control_->handle(cut_);
    state(0.0, cut_.spindle_speed);
  }
  void state(double stamp, double speed, bool armed = true) {
    CncState s;
    s.stamp = stamp;
    s.connected = true;
    s.armed = armed;
    s.spindle_speed = speed;
    control_->handle(s);
  }
  void verdict(double stamp, bool chatter) {
    ChatterState s;
    s.stamp = stamp;
    s.condition = "slot";
    s.valid = true;
    s.chatter = chatter;
    control_->handle(s);
  }
  /// @param share [1] depth over the limit at the speed of the cut
  ChatterAdvice advice(double stamp, double share) {
    ChatterAdvice a;
    a.stamp = stamp;
    a.episode.condition = "slot";
    a.episode.frequency = 1000.0;
    a.speed = cut_.spindle_speed;
    a.engagement = cut_.engagement;
    a.depth = share * makeSolver(Method::collocation, system())->limit(cut_.spindle_speed, 1.0).depth;
    return a;
  }
  void load(double stamp, double value) {
    LoadSample l;
    l.stamp = stamp;
    l.spindle_load = value;
    control_->handle(l);
  }

  MillingControlParameters parameters_;
  std::unique_ptr<MillingControl> control_;
  CuttingCondition cut_;
};

TEST_F(Control, movesToASpeedAtWhichDrawnMachinesAreStable) {
  const ChatterAdvice a = advice(1.0, 1.5);
  control_->handle(a);
  const auto request = control_->takeRequest();
  ASSERT_TRUE(request);
  EXPECT_TRUE(request->chatter);
  EXPECT_NEAR(request->feed, request->spindle, 1e-12);
  EXPECT_GE(request->spindle, 0.8);
  EXPECT_LE(request->spindle, 1.2);
  // Accepted risk, within the scatter of 200 draws of another seed.
  EXPECT_LT(chatterProbability(estimated(), request->spindle * cut_.spindle_speed, a.depth, 200, 99), 0.12);
  EXPECT_NE(request->reason.find("chatter at 1000 Hz"), std::string::npos) << request->reason;
  EXPECT_EQ(request->reason.find('\n'), std::string::npos);
  EXPECT_FALSE(control_->takeRequest());
}

TEST_F(Control, reportsAStableCutAfterTheMove) {
  control_->handle(advice(1.0, 1.5));
  const auto request = control_->takeRequest();
  ASSERT_TRUE(request);
  control_->answer(true, "", 1.05);
  EXPECT_TRUE(control_->moving());
  const double speed = request->spindle * cut_.spindle_speed, turn = units::TWO_PI / speed;
  state(1.1, speed);
  verdict(1.1 + 10.0 * turn, true);  // its window begins before the move
  EXPECT_TRUE(control_->moving());
  verdict(1.1 + 30.0 * turn, false);
  EXPECT_FALSE(control_->moving());
  const auto notes = control_->takeNotes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("slot: cut stable at"), std::string::npos) << notes[0];
}

TEST_F(Control, doesNotActWhileDisarmedOrNotAdaptive) {
  state(0.5, cut_.spindle_speed, false);
  control_->handle(advice(1.0, 1.5));
  EXPECT_FALSE(control_->takeRequest());
  parameters_.adaptive = false;
  const MillingControlParameters off = parameters_;
  start();
  parameters_ = off;
  control_ = std::make_unique<MillingControl>(off, 16, [](const Engagement&) { return estimated(); });
  control_->handle(cut_);
  state(0.0, cut_.spindle_speed);
  control_->handle(advice(1.0, 1.5));
  EXPECT_FALSE(control_->takeRequest());
}

TEST_F(Control, withoutAStableSpeedTheFeedGoesToItsFloor) {
  const ChatterAdvice a = advice(1.0, 40.0);
  control_->handle(a);
  const auto request = control_->takeRequest();
  ASSERT_TRUE(request);
  EXPECT_EQ(request->feed, 0.4);
  EXPECT_EQ(request->spindle, 1.0);
  EXPECT_NE(request->reason.find("no speed from 8000 to 12000 rpm"), std::string::npos) << request->reason;
  control_->answer(true, "", 1.0);
  control_->handle(advice(2.0, 1.5));
  EXPECT_FALSE(control_->takeRequest());
  // The next cut starts from the programmed values.
  cut_.stamp = 3.0;
  control_->handle(cut_);
  state(3.1, cut_.spindle_speed);
  control_->handle(advice(4.0, 1.5));
  EXPECT_TRUE(control_->takeRequest());
}

TEST_F(Control, theProposedNextCutIsStable) {
  const ChatterAdvice a = advice(1.0, 12.0);
  control_->handle(a);
  const auto request = control_->takeRequest();
  ASSERT_TRUE(request);
  if (request->next_speed == 0.0) GTEST_SKIP() << "the cut has a stable speed";
  EXPECT_LT(chatterProbability(estimated(), request->next_speed, request->next_depth, 200, 7), 0.12);
}

TEST_F(Control, aRefusalIsReportedOnceAndEndsTheAttemptsInThisCut) {
  control_->handle(advice(1.0, 1.5));
  ASSERT_TRUE(control_->takeRequest());
  control_->answer(false, "overrides: controlled by the panel", 1.0);
  EXPECT_EQ(control_->spindle(), 1.0);
  const auto notes = control_->takeNotes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0], "slot: overrides unchanged: overrides: controlled by the panel");
  control_->handle(advice(2.0, 1.5));
  EXPECT_FALSE(control_->takeRequest());
  EXPECT_TRUE(control_->takeNotes().empty());
}

TEST_F(Control, aSpindleThatDoesNotReachItsSpeedEndsTheAttempts) {
  control_->handle(advice(1.0, 1.5));
  ASSERT_TRUE(control_->takeRequest());
  control_->answer(true, "", 1.2);
  state(1.5, cut_.spindle_speed);
  EXPECT_TRUE(control_->moving());
  state(3.5, cut_.spindle_speed);
  EXPECT_FALSE(control_->moving());
  EXPECT_EQ(control_->takeNotes().size(), 1u);
}

// A busy computer needs three seconds for advice and answer while the controller's states go on.
TEST_F(Control, theTimeOfTheSpindleBeginsWithTheAnswerOfTheController) {
  control_->handle(advice(1.0, 1.5));
  const auto request = control_->takeRequest();
  ASSERT_TRUE(request);
  state(4.0, cut_.spindle_speed);
  EXPECT_TRUE(control_->moving());
  control_->answer(true, "", 4.1);
  state(4.2, cut_.spindle_speed);
  state(4.9, request->spindle * cut_.spindle_speed);
  EXPECT_TRUE(control_->takeNotes().empty());
  const double turn = units::TWO_PI / (request->spindle * cut_.spindle_speed);
  verdict(4.9 + 30.0 * turn, false);
  const auto notes = control_->takeNotes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("slot: cut stable at"), std::string::npos) << notes[0];
}

// Teeth that meet the waves in phase: a little more than a whole number of waves in a tooth passing period.
TEST_F(Control, withoutModesMovesToTheSpeedThatIsMostProbablyStable) {
  start(false);
  ChatterAdvice a = advice(1.0, 1.5);
  a.teeth = 4;
  a.episode.frequency = 1500.0;  // 2.25 waves at 10,000 rpm
  a.speed = 10000.0 * RPM;
  control_->handle(a);
  const auto request = control_->takeRequest();
  ASSERT_TRUE(request);
  EXPECT_GE(request->spindle, 0.8);
  EXPECT_LE(request->spindle, 1.2);
  const double waves = 1500.0 / (4.0 * 10000.0 * request->spindle / 60.0);
  EXPECT_LT(waves - std::floor(waves), 0.2) << request->reason;
  EXPECT_EQ(request->feed, request->spindle);
  // Chatter there: another speed.
  control_->answer(true, "", 1.0);
  state(1.5, request->spindle * 10000.0 * RPM);
  control_->handle(ChatterState{2.5, a.episode.condition, true, true});
  a.speed = request->spindle * 10000.0 * RPM;
  a.episode.frequency = 1510.0;
  control_->handle(a);
  const auto second = control_->takeRequest();
  ASSERT_TRUE(second);
  EXPECT_GT(std::abs(second->spindle - request->spindle), 0.01) << second->reason;
}

TEST_F(Control, loadDecreasesTheFeedFiveTimesAsFastAsItIncreasesIt) {
  parameters_.load_target = 0.6;
  parameters_.feed_rise = 0.05;
  start();
  double t = 1.0;
  const auto run = [&](double value, double seconds) {
    for (const double end = t + seconds; t < end; t += 0.02) {
      load(t, value);
      if (control_->takeRequest()) control_->answer(true, "", t);
    }
  };
  run(1.2, 1.0);
  const double down = 1.0 - control_->feed();
  EXPECT_NEAR(down, 0.25, 0.03);  // 5 x 0.05 per second
  run(std::nan(""), 5.0);         // an unknown load is ignored
  EXPECT_NEAR(control_->feed(), 1.0 - down, 1e-12);
  const double before = control_->feed();
  run(0.1, 2.0);
  EXPECT_NEAR(control_->feed() - before, 0.1, 0.03);
  run(5.0, 20.0);
  EXPECT_EQ(control_->feed(), 0.4);  // the floor
  EXPECT_EQ(control_->spindle(), 1.0);
  // The first load after a gap is ignored.
  t += 30.0;
  load(t, 0.0);
  EXPECT_FALSE(control_->takeRequest());
}

TEST(StableSpeed, isEmptyWithoutAStableSpeed) {
  EXPECT_FALSE(stableSpeed(estimated(), 1.0, 800.0, 1200.0));
  EXPECT_THROW(stableSpeed(estimated(), 0.0, 800.0, 1200.0), Error);
}

// With uncertain coefficients only, the limit is proportional to 1 / K: the relative depth at a risk is a
// quantile of the log-normal distribution, independent of the speed.
TEST(DepthsAtRisk, haveTheClosedForm) {
  RegenerativeSystem mean = system();
  constexpr double SHARE = 0.2;
  const UncertainSystem uncertain(mean, std::vector<ModeUncertainty>(mean.modes.size()), SHARE, 0.0);
  mean.kr = 0.0;
  const UncertainSystem tangential(mean, std::vector<ModeUncertainty>(mean.modes.size()), SHARE, 0.0);
  std::vector<double> speeds;
  for (int i = 0; i < 20; ++i) speeds.push_back(900.0 + 20.0 * i);
  const DrawnLimits limits = drawnLimits(tangential, speeds, 800, 3);
  const double sigma = std::sqrt(std::log1p(SHARE * SHARE));
  const double expected = 1.0 / std::exp(1.644854 * sigma - 0.5 * sigma * sigma);
  for (const double share : depthsAtRisk(limits, speeds, 0.05, 0.0))
    EXPECT_NEAR(share, expected, 0.045);  // four standard errors of 800 draws
  // A speed margin can only reduce the depth.
  const auto wide = depthsAtRisk(limits, speeds, 0.05, 0.03), none = depthsAtRisk(limits, speeds, 0.05, 0.0);
  for (std::size_t k = 0; k < speeds.size(); ++k) EXPECT_LE(wide[k], none[k] + 1e-12);
}

}  // namespace
}  // namespace smartmill::stability
