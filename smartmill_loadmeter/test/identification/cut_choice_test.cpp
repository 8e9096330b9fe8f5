#include "smartmill_loadmeter/identification/cut_choice.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/session_identification.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const ToolGeometry TOOL{4, 0.01905, units::radFromDeg(30.0), {}};
constexpr double SPEED = 418.9;   // [rad/s] of the cuts of a session
constexpr double STEADY = 2.0;    // [s]
constexpr double MARGIN = 2e-3;   // [m] between slots
constexpr double LEAVING = 0.58;  // [s] of a half immersion cut from its side
const std::vector<double> FEEDS{5e-5, 1e-4, 1.5e-4, 2e-4};

Spindle spindle() {
  Spindle s;
  s.load_meter_gain = 3.88e-4;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_resolution = 3e-4;
  s.load_meter_full_scale = 8.0;
  return s;
}

CuttingCondition airCut(double speed) {
  CuttingCondition air;
  air.kind = CuttingCondition::Kind::air;
  air.name = "air";
  air.tool = TOOL;
  air.spindle_speed = speed;
  return air;
}

// As the session lays it: entry over the diameter of the tool, then steady, then 0.1 s of run-out.
CandidateCut candidate(double entry, double exit, double depth, double feed_per_tooth) {
  CandidateCut cut;
  CuttingCondition& c = cut.condition;
  c = airCut(SPEED);
  c.kind = CuttingCondition::Kind::cut;
  c.name = exit - entry > 3.0 ? "slot" : entry < 0.1 ? "up" : "down";
  c.engagement = {entry, exit, depth, feed_per_tooth};
  const double feed = feed_per_tooth * TOOL.teeth * SPEED / units::TWO_PI;
  c.steady_to[0] = feed * STEADY;
  cut.cutting_time = STEADY + 0.1 + (TOOL.diameter + 2e-3) / feed + (c.name == "slot" ? 0.0 : LEAVING);
  cut.stock = c.name == "slot" ? TOOL.diameter + MARGIN : TOOL.radius();
  return cut;
}

std::vector<CandidateCut> slots(double depth) {
  std::vector<CandidateCut> cuts;
  for (const double feed : FEEDS) cuts.push_back(candidate(0.0, units::PI, depth, feed));
  return cuts;
}

std::vector<CandidateCut> withHalves(std::vector<CandidateCut> cuts, double up_depth, double down_depth) {
  for (const double feed : FEEDS) cuts.push_back(candidate(0.0, 0.5 * units::PI, up_depth, feed));
  for (const double feed : FEEDS) cuts.push_back(candidate(0.5 * units::PI, units::PI, down_depth, feed));
  return cuts;
}

LoadMeterReadings quiet() {
  LoadMeterReadings readings;
  readings.noise = 2e-3;
  readings.settling = 0.23;
  readings.air_time = 1.25;
  return readings;
}

CutInformation afterAir(const LoadMeterReadings& readings) {
  CutInformation known;
  known.addKnowledge(withoutKnowledge());
  for (const double speed : {314.2, 628.3, 942.5, 1256.6})
    known.addTest(airCut(speed), spindle(), readings.voltageStd(readings.air_time));
  return known;
}

TorqueCovariance afterSlots(const LoadMeterReadings& readings) {
  CutInformation information = afterAir(readings);
  for (const CandidateCut& slot : slots(1e-3))
    information.addTest(slot.condition, spindle(), readings.voltageStd(STEADY - readings.settling));
  return information.covariance().torque();
}

ChoiceGoal goalOf(const TorqueCovariance& target) {
  ChoiceGoal goal;
  goal.ktc_std = std::sqrt(target.tc) * (1.0 + 1e-9);
  goal.kte_std = std::sqrt(target.te) * (1.0 + 1e-9);
  goal.stock = 1.0;
  return goal;
}

double timeOf(const CutChoice& choice, const std::vector<CandidateCut>& candidates) {
  double time = 0.0;
  for (const ChosenCut& cut : choice.cuts) time += candidates[cut.candidate].cutting_time;
  return time;
}

std::set<std::string> namesOf(const CutChoice& choice, const std::vector<CandidateCut>& candidates) {
  std::set<std::string> names;
  for (const ChosenCut& cut : choice.cuts) names.insert(candidates[cut.candidate].condition.name);
  return names;
}

TEST(ChooseCuts, takesSlotsAtEqualDepthAndHalfImmersionWhereItMayBeDeeper) {
  const ChoiceGoal goal = goalOf(afterSlots(quiet()));
  const auto flat = withHalves(slots(1e-3), 1e-3, 1e-3);
  const CutChoice shallow = chooseCuts(afterAir(quiet()), flat, quiet(), spindle(), goal);
  EXPECT_TRUE(shallow.reached);
  EXPECT_EQ(namesOf(shallow, flat), std::set<std::string>{"slot"});
  // Half immersion 4 mm deep has twice the torque of the slots.
  const auto deep = withHalves(slots(1e-3), 4e-3, 1e-3);
  const CutChoice up = chooseCuts(afterAir(quiet()), deep, quiet(), spindle(), goal);
  EXPECT_TRUE(up.reached);
  EXPECT_THAT(namesOf(up, deep), ::testing::Contains("up"));
  EXPECT_LT(timeOf(up, deep), timeOf(shallow, flat));
}

TEST(ChooseCuts, expectsTheCovarianceOfTheChosenCutsAndStopsAtTheTarget) {
  const auto all = withHalves(slots(1e-3), 2e-3, 2e-3);
  ChoiceGoal goal = goalOf(afterSlots(quiet()));
  goal.ktc_std *= 2.0, goal.kte_std *= 2.0;
  const CutChoice choice = chooseCuts(afterAir(quiet()), all, quiet(), spindle(), goal);
  ASSERT_TRUE(choice.reached);
  ASSERT_EQ(choice.cuts.size(), 3u) << "three feeds, for the line of torque over feed";
  CutInformation information = afterAir(quiet());
  double entropy = information.entropy();
  std::set<double> feeds;
  for (const ChosenCut& cut : choice.cuts) {
    const CandidateCut& made = all[cut.candidate];
    information.addTest(made.condition, spindle(), quiet().voltageStd(STEADY - quiet().settling));
    EXPECT_NEAR(cut.ktc_std, std::sqrt(information.covariance().torque().tc), 1e-6 * cut.ktc_std);
    EXPECT_NEAR(cut.kte_std, std::sqrt(information.covariance().torque().te), 1e-6 * cut.kte_std);
    EXPECT_NEAR(cut.gain_per_second * made.cutting_time, entropy - information.entropy(), 1e-6);
    entropy = information.entropy();
    feeds.insert(made.condition.engagement.feed_per_tooth);
  }
  EXPECT_EQ(feeds.size(), 3u);
  EXPECT_LE(choice.cuts.back().ktc_std, goal.ktc_std);
  EXPECT_LE(choice.cuts.back().kte_std, goal.kte_std);
  goal.least_feeds = 2;
  EXPECT_EQ(chooseCuts(afterAir(quiet()), all, quiet(), spindle(), goal).cuts.size(), 2u);
  goal.ktc_std = 1.0;
  EXPECT_FALSE(chooseCuts(afterAir(quiet()), all, quiet(), spindle(), goal).reached);
}

TEST(ChooseCuts, staysWithinStabilityTorquePowerAndStock) {
  auto all = withHalves(slots(1e-3), 2e-3, 2e-3);
  for (CandidateCut& cut : all) cut.depth_limit = cut.condition.name == "down" ? 2.4e-3 : 4e-3;
  ChoiceGoal goal = goalOf(afterSlots(quiet()));
  const CutChoice stable = chooseCuts(afterAir(quiet()), all, quiet(), spindle(), goal);
  ASSERT_EQ(stable.excluded.size(), FEEDS.size()) << "2 mm is above 80 % of 2.4 mm";
  EXPECT_EQ(stable.excluded.front(),
            "down: 2.00 mm deep, expected at most 1.92 mm, 80 % of the stability limit");
  EXPECT_EQ(namesOf(stable, all).count("down"), 0u);
  // N a R / (2 pi) (2 f Ktc + pi Kte) at 0.2 mm: 1.46 N m, at 0.15 mm: 1.21 N m.
  goal.highest.ktc = 1e9, goal.highest.kte = 1.3e4;
  const double highest = 4 * 1e-3 * TOOL.radius() / units::TWO_PI;
  goal.torque = highest * (2.0 * 1.75e-4 * 1e9 + units::PI * 1.3e4);
  const CutChoice weak = chooseCuts(afterAir(quiet()), all, quiet(), spindle(), goal);
  EXPECT_THAT(weak.excluded.front(), HasSubstr("N m, limit"));
  for (const ChosenCut& cut : weak.cuts)
    EXPECT_LT(all[cut.candidate].condition.engagement.feed_per_tooth, 1.75e-4);
  goal.power = goal.torque * SPEED, goal.torque = 0.0;
  EXPECT_THAT(chooseCuts(afterAir(quiet()), all, quiet(), spindle(), goal).excluded.front(),
              HasSubstr("W, limit"));
  // A stock as wide as one slot and two half immersions still has space for three feeds.
  goal = goalOf(afterSlots(quiet()));
  goal.stock = TOOL.diameter + MARGIN + 2.0 * TOOL.radius();
  const CutChoice narrow = chooseCuts(afterAir(quiet()), all, quiet(), spindle(), goal);
  double used = 0.0;
  std::set<double> feeds;
  for (const ChosenCut& cut : narrow.cuts) {
    used += all[cut.candidate].stock;
    feeds.insert(all[cut.candidate].condition.engagement.feed_per_tooth);
  }
  EXPECT_LE(used, goal.stock * (1.0 + 1e-6));
  EXPECT_GE(feeds.size(), 3u);
}

// ----------------------------------------------------------------- drawn machines

struct Machine {
  CuttingCoefficients k;
  double coulomb, viscous, noise;
  double slot_limit, up_limit, down_limit;  // [m] of stability
};

Machine draw(unsigned seed) {
  std::mt19937 random(seed);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  Machine m{};
  m.k.ktc = between(6e8, 2.5e9);
  m.k.kte = between(1e4, 5e4);
  m.coulomb = between(0.03, 0.3);
  m.viscous = between(1e-4, 6e-4);
  m.noise = std::exp(between(std::log(3e-4), std::log(1e-2)));
  // The demonstration mill: slot 1.2 mm, half immersion up 4.4 mm, down 2.3 mm.
  m.slot_limit = 1.25e-3;
  m.up_limit = m.slot_limit * between(1.2, 4.0);
  m.down_limit = m.slot_limit * between(1.2, 4.0);
  return m;
}

/// Readings of the load meter at 50 Hz in a steady test.
LoadTest measure(const Machine& m, const CuttingCondition& condition, double time, double stamp,
                 std::mt19937& random) {
  LoadTest test;
  test.condition = condition;
  test.speed = condition.spindle_speed;
  double torque = m.coulomb + m.viscous * test.speed;
  if (test.isCut()) torque += MechanisticForce(condition.tool, m.k, condition.engagement).mean().torque;
  std::normal_distribution<double> normal(3.88e-4 * test.speed * torque, m.noise);
  test.readings = static_cast<int>(time / 0.02);
  for (int i = 0; i < test.readings; ++i) {
    test.voltages.push_back(3e-4 * std::round(normal(random) / 3e-4));
    test.times.push_back(0.02 * i);
  }
  test.duration = test.times.back();
  test.stamp = stamp + test.duration;
  test.computeMean(spindle(), 3e-4);
  return test;
}

struct Outcome {
  double time = 0.0, ktc_std = 0.0, kte_std = 0.0;  // [s] of cutting; expected
  double ktc_error = 0.0, kte_error = 0.0;          // of the identification
  double stated_ktc = 0.0, stated_kte = 0.0;
  std::size_t cuts = 0, halves = 0;
};

/// Air cuts, the cuts and the identification of one machine.
class Shop {
 public:
  explicit Shop(unsigned seed) : machine_(draw(seed)), random_(seed + 1000) {
    for (const double speed : {314.2, 628.3, 942.5, 1256.6}) {
      air_.push_back(measure(machine_, airCut(speed), 1.25, stamp_, random_));
      stamp_ += 5.0;
    }
    readings_ = readingsOf(air_, spindle(), 0.23);
    known_.addKnowledge(withoutKnowledge());
    for (const LoadTest& air : air_)
      known_.addTest(air.condition, spindle(), readings_.voltageStd(readings_.air_time));
  }

  const Machine& machine() const { return machine_; }

  TorqueCovariance expected(const std::vector<CandidateCut>& cuts) const {
    CutInformation information = known_;
    for (const CandidateCut& cut : cuts)
      information.addTest(cut.condition, spindle(),
                          readings_.voltageStd(steadyTime(cut.condition) - readings_.settling));
    return information.covariance().torque();
  }

  CutChoice choose(const std::vector<CandidateCut>& candidates, const TorqueCovariance& target) const {
    return chooseCuts(known_, candidates, readings_, spindle(), goalOf(target));
  }

  Outcome make(const std::vector<CandidateCut>& cuts) {
    Outcome outcome;
    std::vector<LoadTest> tests;
    for (const CandidateCut& cut : cuts) {
      tests.push_back(measure(machine_, cut.condition, STEADY - readings_.settling, stamp_, random_));
      stamp_ += 10.0;
      outcome.time += cut.cutting_time;
      outcome.halves += cut.condition.name == "slot" ? 0 : 1;
    }
    outcome.cuts = cuts.size();
    const TorqueCovariance expected_covariance = expected(cuts);
    outcome.ktc_std = std::sqrt(expected_covariance.tc);
    outcome.kte_std = std::sqrt(expected_covariance.te);
    const CoefficientSet found = identifyFromTests(air_, tests, spindle(), 0.0).record.set;
    outcome.ktc_error = found.value.ktc - machine_.k.ktc;
    outcome.kte_error = found.value.kte - machine_.k.kte;
    outcome.stated_ktc = found.std_dev.ktc;
    outcome.stated_kte = found.std_dev.kte;
    return outcome;
  }

 private:
  Machine machine_;
  std::mt19937 random_;
  std::vector<LoadTest> air_;
  LoadMeterReadings readings_;
  CutInformation known_;
  double stamp_ = 100.0;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Seconds of cutting and coverage over drawn machines.
struct Study {
  std::vector<double> seconds, seconds_of_slots, per_second;  // per_second: information ratio to the slots
  Coverage expected_ktc, expected_kte, stated_ktc, stated_kte;
  std::size_t reached = 0, halves = 0, cuts = 0, longer = 0;

  void add(const Outcome& slots, const Outcome& chosen, bool is_reached) {
    seconds.push_back(chosen.time);
    seconds_of_slots.push_back(slots.time);
    const auto rate = [](const Outcome& o) { return 1.0 / (o.ktc_std * o.ktc_std * o.time); };
    per_second.push_back(rate(chosen) / rate(slots));
    expected_ktc.add(chosen.ktc_error, chosen.ktc_std);
    expected_kte.add(chosen.kte_error, chosen.kte_std);
    stated_ktc.add(chosen.ktc_error, chosen.stated_ktc);
    stated_kte.add(chosen.kte_error, chosen.stated_kte);
    reached += is_reached ? 1 : 0;
    longer += chosen.time > slots.time * (1.0 + 1e-9) ? 1 : 0;
    halves += chosen.halves;
    cuts += chosen.cuts;
  }
  void print(const char* what) const {
    std::printf(
        "%s: %.1f s of cutting (slots %.1f s), information on Ktc per second %.2f times that of the slots, "
        "%zu of %zu cuts of half immersion, target reached by %zu of %zu, longer than the slots in %zu; "
        "rms of error over expected deviation: Ktc %.2f, Kte %.2f, over stated: %.2f, %.2f\n",
        what, median(seconds), median(seconds_of_slots), median(per_second), halves, cuts, reached,
        seconds.size(), longer, expected_ktc.rms(), expected_kte.rms(), stated_ktc.rms(), stated_kte.rms());
  }
};

// @param depths of half immersion, up and down, of a machine
template <typename Depths>
Study studyOf(const Depths& depths) {
  Study study;
  for (unsigned seed = 1; seed <= Coverage::RUNS; ++seed) {
    Shop shop(seed);
    const std::vector<CandidateCut> full = slots(1e-3);
    const auto [up, down] = depths(shop.machine());
    std::vector<CandidateCut> candidates = withHalves(full, up, down);
    for (CandidateCut& cut : candidates) {
      const std::string& kind = cut.condition.name;
      const Machine& m = shop.machine();
      cut.depth_limit = kind == "slot" ? m.slot_limit : kind == "up" ? m.up_limit : m.down_limit;
    }
    const CutChoice choice = shop.choose(candidates, shop.expected(full));
    std::vector<CandidateCut> chosen;
    for (const ChosenCut& cut : choice.cuts) chosen.push_back(candidates[cut.candidate]);
    const Outcome of_slots = shop.make(full);
    study.add(of_slots, shop.make(chosen), choice.reached);
  }
  return study;
}

// With the standard deviations of the four slots as target.
TEST(ChooseCuts, reachesThePrecisionOfTheSlotsInFewerSecondsWithCalibratedDeviations) {
  const Study twice = studyOf([](const Machine&) { return std::pair{2e-3, 2e-3}; });
  twice.print("half immersion twice as deep as the slots, where stable");
  const Study deep = studyOf([](const Machine& m) {
    return std::pair{0.79 * m.up_limit, 0.79 * m.down_limit};
  });
  deep.print("half immersion as deep as stable");
  for (const Study* study : {&twice, &deep}) {
    EXPECT_EQ(study->reached, static_cast<std::size_t>(Coverage::RUNS)) << "the slots are candidates";
    EXPECT_EQ(study->longer, 0u);
    EXPECT_LE(median(study->seconds), median(study->seconds_of_slots));
    EXPECT_TRUE(study->expected_ktc.isCalibrated());
    EXPECT_TRUE(study->expected_kte.isCalibrated());
    EXPECT_TRUE(study->stated_ktc.isCalibrated());
    EXPECT_TRUE(study->stated_kte.isCalibrated());
  }
  EXPECT_LT(median(deep.seconds), median(deep.seconds_of_slots));
  EXPECT_GT(deep.halves, 0u);
}

TEST(LoadMeterReadings, areThoseOfTheAirCuts) {
  std::mt19937 random(3);
  Machine m{};
  m.coulomb = 0.1, m.viscous = 3e-4, m.noise = 2e-3;
  std::vector<LoadTest> air;
  for (int i = 0; i < 40; ++i) air.push_back(measure(m, airCut(500.0 + 10.0 * i), 2.0, 10.0 * i, random));
  const LoadMeterReadings readings = readingsOf(air, spindle(), 0.2);
  // 40 tests of 100 readings: their scatter is known to about 1.1 %, four times that for its root mean.
  EXPECT_NEAR(readings.noise, 2e-3, 0.1 * 2e-3);
  EXPECT_NEAR(readings.period, 0.02, 1e-9);
  EXPECT_NEAR(readings.voltageStd(4.0), readings.noise / std::sqrt(200.0), 1e-6);
  EXPECT_NEAR(readings.rounding, 0.0, 1e-9) << "noise of several steps";
  // Without noise each air cut is on one step: the differences between air cuts are no resolution.
  m.noise = 1e-9;
  for (LoadTest& test : air) test = measure(m, test.condition, 2.0, test.stamp, random);
  EXPECT_NEAR(readingsOf(air, spindle(), 0.2).voltageStd(4.0), 3e-4 / std::sqrt(12.0), 1e-9);
  const LoadMeterReadings none = readingsOf({}, spindle(), 0.2);
  EXPECT_NEAR(none.voltageStd(100.0), 3e-4 / std::sqrt(12.0), 1e-6) << "one step, whatever the time";
}

}  // namespace
}  // namespace smartmill::loadmeter
