#include "smartmill_loadmeter/identification/production.h"

#include <cmath>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/production_run.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;
using units::radPerSecFromRpm;

const ToolGeometry TOOL{3, 0.012, units::radFromDeg(35.0), {}};

double torqueOf(const Engagement& e, double ktc, double kte) {
  return MechanisticForce(TOOL, {ktc, 0, 0, kte, 0, 0}, e).mean().torque;
}

// Production cut with random engagement, depth and feed.
TorqueMeasurement reading(std::mt19937& random, double ktc, double kte, double std_dev) {
  std::uniform_real_distribution<double> uniform;
  std::normal_distribution<double> normal;
  TorqueMeasurement r;
  r.tool = TOOL;
  r.engagement.entry = uniform(random) < 0.5 ? 0.0 : 1.5 * uniform(random);
  r.engagement.exit = r.engagement.entry + 0.5 + (units::PI - r.engagement.entry - 0.5) * uniform(random);
  r.engagement.axial_depth = 0.001 + 0.004 * uniform(random);
  r.engagement.feed_per_tooth = 3e-5 + 9e-5 * uniform(random);
  r.torque = torqueOf(r.engagement, ktc, kte) + std_dev * normal(random);
  r.torque_std = std_dev;
  r.cutting_time = 10.0;
  return r;
}

struct Batch {
  double ktc, kte, ktc_std;
};

// Weighted least squares of the mean torque over measurements, two unknowns in closed form (eq. 3.19 for any
// engagement).
Batch regression(const std::vector<TorqueMeasurement>& readings) {
  double cc = 0.0, ce = 0.0, ee = 0.0, ct = 0.0, et = 0.0;
  for (const TorqueMeasurement& r : readings) {
    const double c = torqueOf(r.engagement, 1.0, 0.0), e = torqueOf(r.engagement, 0.0, 1.0);
    const double weight = 1.0 / (r.torque_std * r.torque_std);
    cc += weight * c * c;
    ce += weight * c * e;
    ee += weight * e * e;
    ct += weight * c * r.torque;
    et += weight * e * r.torque;
  }
  const double determinant = cc * ee - ce * ce;
  return {(ee * ct - ce * et) / determinant, (cc * et - ce * ct) / determinant, std::sqrt(ee / determinant)};
}

TEST(Recursive, withoutForgettingIsTheBatchRegression) {
  std::mt19937 random(1);
  RecursiveCoefficients recursive({}, 1e12);
  std::vector<TorqueMeasurement> readings;
  for (int i = 0; i < 40; ++i) {
    readings.push_back(reading(random, 953e6, 17.3e3, 0.005));
    recursive.update(readings.back());
  }
  const Batch all = regression(readings);
  EXPECT_NEAR(recursive.ktc(), all.ktc, 1e-4 * all.ktc);  // the initial uncertainty
  EXPECT_NEAR(recursive.kte(), all.kte, 1e-3 * all.kte);
  EXPECT_NEAR(recursive.ktcStd(), all.ktc_std, 1e-3 * all.ktc_std);
}

TEST(Recursive, standardDeviationsAreCalibrated) {
  Coverage ktc, kte;
  constexpr int READINGS = 60;
  constexpr double MEMORY = 300.0;
  // Measurements of 10 s are weighted by w = exp(-10 s / memory) each. The stated variance treats them as sum
  // w measurements, for drifting values; the variance of constant values is smaller by sum w^2 / sum w.
  double weights = 0.0, squares = 0.0;
  for (int i = 0; i < READINGS; ++i) {
    const double weight = std::exp(-10.0 * i / MEMORY);
    weights += weight;
    squares += weight * weight;
  }
  const double still = std::sqrt(squares / weights);
  for (int run = 0; run < Coverage::RUNS; ++run) {
    std::mt19937 random(static_cast<unsigned>(run) + 1);
    RecursiveCoefficients recursive({}, MEMORY);
    for (int i = 0; i < READINGS; ++i) recursive.update(reading(random, 953e6, 17.3e3, 0.01));
    ktc.add(recursive.ktc() - 953e6, still * recursive.ktcStd());
    kte.add(recursive.kte() - 17.3e3, still * recursive.kteStd());
  }
  EXPECT_TRUE(ktc.isCalibrated());
  EXPECT_TRUE(kte.isCalibrated());
}

// The torques scatter by five times what they state, as with a load meter whose readings are late.
TEST(Recursive, torquesThatContradictEachOtherIncreaseTheDeviations) {
  Coverage ktc, kte;
  for (int run = 0; run < Coverage::FEW; ++run) {
    std::mt19937 random(static_cast<unsigned>(run) + 1);
    RecursiveCoefficients recursive({}, 1e12);
    for (int i = 0; i < 40; ++i) {
      TorqueMeasurement one = reading(random, 953e6, 17.3e3, 0.05);
      one.torque_std = 0.01;
      recursive.update(one);
    }
    EXPECT_NEAR(recursive.misfit(), 5.0, 2.0);
    ktc.add(recursive.ktc() - 953e6, recursive.ktcStd());
    kte.add(recursive.kte() - 17.3e3, recursive.kteStd());
  }
  EXPECT_TRUE(ktc.isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
  EXPECT_TRUE(kte.isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
}

// All torques are wrong by one draw of the common error: that of the friction, from a few air cuts.
TEST(Recursive, aCommonErrorOfTheTorquesIsPartOfTheDeviations) {
  Coverage ktc, kte;
  constexpr double COMMON = 0.02;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    std::mt19937 random(static_cast<unsigned>(run) + 1);
    std::normal_distribution<double> normal;
    const double shift = COMMON * normal(random);
    RecursiveCoefficients recursive({}, 1e12);
    for (int i = 0; i < 60; ++i) {
      TorqueMeasurement one = reading(random, 953e6, 17.3e3, 0.01);
      one.torque += shift;
      one.common_std = COMMON;
      recursive.update(one);
    }
    ktc.add(recursive.ktc() - 953e6, recursive.ktcStd());
    kte.add(recursive.kte() - 17.3e3, recursive.kteStd());
  }
  EXPECT_TRUE(ktc.isCalibrated());
  EXPECT_TRUE(kte.isCalibrated());
}

TEST(Recursive, followsEdgeWear) {
  std::mt19937 random(7);
  RecursiveCoefficients recursive({}, 120.0);
  double minutes = 0.0;
  for (int i = 0; i < 300; ++i) {
    minutes += 10.0 / 60.0;
    recursive.update(reading(random, 953e6, 17.3e3 * (1.0 + 0.05 * minutes), 0.01));
  }
  // After 50 minutes; the estimate lags by the memory of two minutes.
  EXPECT_NEAR(recursive.kte(), 17.3e3 * (1.0 + 0.05 * (minutes - 2.0)), 4.0 * recursive.kteStd());
  EXPECT_NEAR(recursive.ktc(), 953e6, 4.0 * recursive.ktcStd());
  EXPECT_GT(recursive.kte(), 3.0 * 17.3e3);
}

TEST(Recursive, oneFeedStaysBoundedAndAChippedEdgeIsDetected) {
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  RecursiveCoefficients recursive({900e6, 15e3, 90e6, 5e3}, 60.0);
  TorqueMeasurement r;
  r.tool = TOOL;
  r.engagement = {0.0, units::PI, 0.003, 6e-5};
  r.torque_std = 0.01;
  r.cutting_time = 10.0;
  for (int i = 0; i < 2000; ++i) {
    r.torque = torqueOf(r.engagement, 953e6, 17.3e3) + 0.01 * normal(random);
    recursive.update(r);
    ASSERT_LE(recursive.ktcStd(), 90e6 * 1.0001);
    ASSERT_LE(recursive.kteStd(), 5e3 * 1.0001);
  }
  // The torque of these cuts is well determined.
  EXPECT_NEAR(torqueOf(r.engagement, recursive.ktc(), recursive.kte()), torqueOf(r.engagement, 953e6, 17.3e3),
              0.01);
  r.torque *= 1.2;
  recursive.update(r);
  EXPECT_GT(recursive.normalisedInnovation(), 5.0);
  r.torque_std = 0.0;
  EXPECT_THAT(errorOf([&] { recursive.update(r); }), HasSubstr("standard deviation > 0"));
}

LoadTest cutWithTool(double duration) {
  LoadTest cut;
  cut.condition.tool_name = "end_mill";
  cut.condition.tool = TOOL;
  cut.duration = duration;
  return cut;
}

// A torque that falls with the feed, as of loads and engagement that do not belong together.
TEST(ProductionRun, givesNoRecordOfANegativeCoefficient) {
  ProductionRun run(1800.0);
  LoadTest cut = cutWithTool(1.0);
  int records = 0;
  for (const auto& [feed, torque] : {std::pair{3e-5, 1.0}, {9e-5, 0.2}, {3e-5, 1.0}, {9e-5, 0.2}}) {
    cut.condition.engagement = {0.0, units::PI, 0.003, feed};
    records += run.add(cut, Estimate{torque, 0.01}, 0.01).has_value();
  }
  ASSERT_LT(run.estimate()->ktc(), 0.0);
  EXPECT_EQ(records, 1);  // the first cut alone says nothing of the slope
}

// Cuts of a pocket along x and y: half of them slots, half steps, at three feeds. The force sensor's gain is
// wrong by one draw for all of them.
TEST(ProductionRun, radialAndAxialCoefficientsFollowFromMeasuredForces) {
  const CuttingCoefficients truth{953e6, 400e6, 150e6, 17.3e3, 15e3, 2e3};
  constexpr double GAIN = 0.005, NOISE = 0.3, TORQUE_NOISE = 0.005;
  Coverage krc, kre, kac;
  for (int number = 0; number < Coverage::RUNS; ++number) {
    std::mt19937 random(static_cast<unsigned>(number) + 1);
    std::normal_distribution<double> normal;
    const double gain = 1.0 + GAIN * normal(random);
    ProductionRun run(1800.0);
    std::optional<CoefficientRecord> last;
    int cuts = 0;
    for (int k = 0; k < 12; ++k) {
      LoadTest cut = cutWithTool(2.0);
      cut.condition.kind = CuttingCondition::Kind::cut;
      cut.condition.engagement = {0.0, k % 2 == 0 ? units::PI : 1.2, 0.003, 4e-5 + 3e-5 * (k % 3)};
      cut.condition.steady_to =
          k % 4 < 2 ? std::array<double, 3>{{0.1, 0, 0}} : std::array<double, 3>{{0, -0.1, 0}};
      const CuttingForce force = MechanisticForce(TOOL, truth, cut.condition.engagement).mean();
      // Along the feed and across it, in the machine.
      const double heading = k % 4 < 2 ? 0.0 : -0.5 * units::PI, c = std::cos(heading), s = std::sin(heading);
      const std::array<double, 3> mean{{c * force.fx - s * force.fy, s * force.fx + c * force.fy, force.fz}};
      MeanForce measured;
      measured.gain_error = GAIN;
      for (std::size_t a = 0; a < 3; ++a)
        measured.axis[a] = Estimate{gain * mean[a] + NOISE * normal(random), NOISE};
      last = run.add(cut, Estimate{force.torque + TORQUE_NOISE * normal(random), TORQUE_NOISE}, TORQUE_NOISE,
                     measured);
      ++cuts;
    }
    ASSERT_TRUE(last);
    const double share = 1.0 / std::sqrt(static_cast<double>(cuts));
    krc.add(last->set.value.krc - truth.krc, share * last->set.std_dev.krc);
    kre.add(last->set.value.kre - truth.kre, share * last->set.std_dev.kre);
    kac.add(last->set.value.kac - truth.kac, share * last->set.std_dev.kac);
    EXPECT_NEAR(last->set.value.krc, truth.krc, 0.03 * truth.krc);
    EXPECT_NEAR(last->covariance[CoefficientRecord::covarianceIndex(1, 1)],
                std::pow(last->set.std_dev.krc, 2), 1e-6 * std::pow(last->set.std_dev.krc, 2));
  }
  // Scatter beyond the stated one widens the deviations of a third of the runs.
  for (const Coverage* one : {&krc, &kre, &kac}) EXPECT_TRUE(one->isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
}

// The load meter alone, a cut along an arc: no radial coefficient.
TEST(ProductionRun, withoutForcesThereAreNoRadialCoefficients) {
  ProductionRun run(1800.0);
  LoadTest cut = cutWithTool(1.0);
  std::optional<CoefficientRecord> last;
  for (const double feed : {3e-5, 9e-5}) {
    cut.condition.engagement = {0.0, units::PI, 0.003, feed};
    last = run.add(cut, Estimate{torqueOf(cut.condition.engagement, 953e6, 17.3e3), 0.01}, 0.01);
  }
  ASSERT_TRUE(last);
  EXPECT_TRUE(std::isnan(last->set.value.krc));
  EXPECT_TRUE(std::isfinite(last->set.value.ktc));
}

Spindle spindleOf() {
  Spindle s;
  s.load_meter_gain = 3.88e-4;
  return s;
}

CandidateCuts candidates() {
  CandidateCuts c;
  for (const double rpm : {2000.0, 4000.0, 6000.0, 9000.0}) c.speeds.push_back(radPerSecFromRpm(rpm));
  c.feeds = {3e-5, 5e-5, 7e-5, 9e-5, 1.1e-4};
  c.axial_depths = {0.001, 0.002, 0.003};
  return c;
}

TEST(Plan, satisfiesTheLimitsAndReachesTheTargetsOnASimulatedMachine) {
  CutLimits limits{3.5, 1500.0, [](double speed, const Engagement&) {
                     return speed > radPerSecFromRpm(5000) && speed < radPerSecFromRpm(7000) ? 0.0015
                                                                                             : 0.0025;
                   }};
  const CuttingCoefficients expected{953e6, 0, 0, 17.3e3, 0, 0};
  const TestPlan plan = planTests(TOOL, spindleOf(), expected, candidates(), limits, 1e-3, 10e6, 0.6e3, 20);
  std::set<double> feeds;
  for (const PlannedCut& cut : plan.cuts) {
    EXPECT_LE(cut.torque, 3.5);
    EXPECT_LE(cut.power, 1500.0);
    EXPECT_LE(cut.engagement.axial_depth, limits.stable_depth(cut.speed, cut.engagement));
    feeds.insert(cut.engagement.feed_per_tooth);
  }
  EXPECT_GE(feeds.size(), 3u);
  EXPECT_LE(plan.ktc_std, 10e6);
  EXPECT_LE(plan.kte_std, 0.6e3);
  // 200 simulated runs of the plan.
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  double ktc2 = 0.0, kte2 = 0.0;
  for (int run = 0; run < 200; ++run) {
    std::vector<TorqueMeasurement> readings;
    for (const PlannedCut& cut : plan.cuts) {
      const double s = std::sqrt(2.0) * 1e-3 / (3.88e-4 * cut.speed);
      readings.push_back({TOOL, cut.engagement, cut.torque + s * normal(random), s});
    }
    const Batch k = regression(readings);
    ktc2 += std::pow(k.ktc - expected.ktc, 2) / 200.0;
    kte2 += std::pow(k.kte - expected.kte, 2) / 200.0;
  }
  EXPECT_NEAR(std::sqrt(ktc2), plan.ktc_std, 0.2 * plan.ktc_std);  // 4 sigma of 200 runs
  EXPECT_NEAR(std::sqrt(kte2), plan.kte_std, 0.2 * plan.kte_std);
}

TEST(Plan, noFewerCutsReachTheTargets) {
  CandidateCuts few = candidates();
  few.speeds = {radPerSecFromRpm(3000), radPerSecFromRpm(6000)};
  few.axial_depths = {0.002};
  const CutLimits limits{100.0, 1e5, {}};
  const CuttingCoefficients expected{953e6, 0, 0, 17.3e3, 0, 0};
  const double target_ktc = 40e6, target_kte = 1.5e3;
  for (const double voltage_std : {2e-3, 3e-3, 3.6e-3}) {
    const TestPlan plan =
        planTests(TOOL, spindleOf(), expected, few, limits, voltage_std, target_ktc, target_kte, 30);
    const std::size_t n = plan.cuts.size();
    if (n <= 3) continue;
    // Every selection of one cut fewer, with repetition.
    struct Row {
      double tc, te, v;
    };
    std::vector<Row> rows;
    for (const double w : few.speeds) {
      for (const double f : few.feeds) {
        const auto m = meanForceMatrix(TOOL, {0.0, units::PI, 0.002, f});
        rows.push_back({m[3][0], m[3][3], 2.0 * std::pow(voltage_std / (3.88e-4 * w), 2)});
      }
    }
    bool reached = false;
    std::vector<std::size_t> at(n - 1, 0);
    for (bool more = n <= 6; more;) {
      double a = 0.0, b = 0.0, c = 0.0;
      for (const std::size_t k : at) {
        a += rows[k].tc * rows[k].tc / rows[k].v;
        b += rows[k].tc * rows[k].te / rows[k].v;
        c += rows[k].te * rows[k].te / rows[k].v;
      }
      const double d = a * c - b * b;
      reached = reached || (d > 0.0 && std::sqrt(c / d) <= target_ktc && std::sqrt(a / d) <= target_kte);
      std::size_t i = 0;
      while (i < at.size() && at[i] + 1 == rows.size()) ++i;
      more = i < at.size();
      if (more) {
        ++at[i];
        for (std::size_t j = 0; j < i; ++j) at[j] = at[i];
      }
    }
    // The rule of three different feeds adds one cut at most.
    EXPECT_TRUE(!reached || n <= 4u) << voltage_std;
  }
}

TEST(Plan, namesLimitsThatPreventAPlan) {
  const CuttingCoefficients expected{953e6, 0, 0, 17.3e3, 0, 0};
  EXPECT_THAT(errorOf([&] {
                planTests(TOOL, spindleOf(), expected, candidates(), {0.1, 1e5, {}}, 1e-3, 1e7, 1e3, 10);
              }),
              HasSubstr("0 feeds within the limits"));
  EXPECT_THAT(errorOf([&] {
                planTests(TOOL, spindleOf(), expected, candidates(), {10.0, 1e5, {}}, 1e-2, 1e5, 10.0, 10);
              }),
              HasSubstr("only"));
}

}  // namespace
}  // namespace smartmill::loadmeter
