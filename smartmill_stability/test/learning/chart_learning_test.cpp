#include "smartmill_stability/learning/chart_learning.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using units::MM;
using units::radFromDeg;
using units::radPerSecFromRpm;

RegenerativeSystem slot() {
  RegenerativeSystem cut;
  cut.teeth = 3;
  cut.diameter = 0.012;
  cut.exit = units::PI;
  return cut;
}

SystemMode modeOf(std::size_t axis, double frequency, double damping, double stiffness) {
  SystemMode mode;
  mode.frequency = frequency;
  mode.damping_ratio = damping;
  mode.input[axis] = mode.output[axis] = units::TWO_PI * frequency / std::sqrt(stiffness);
  return mode;
}

/// A tool with one mode in each direction, in aluminium.
RegenerativeSystem truth() {
  RegenerativeSystem machine = slot();
  machine.kt = 8e8;
  machine.kr = 0.3 * machine.kt;
  machine.modes = {modeOf(0, 1450.0, 0.025, 1.5e7), modeOf(1, 1510.0, 0.03, 1.6e7)};
  return machine;
}

const CutRange RANGE{radPerSecFromRpm(6000.0), radPerSecFromRpm(18000.0), 12.0 * MM};

/// Fewer machines than by default: a test takes a second.
LearningOptions quick() {
  LearningOptions options;
  options.candidates = 2000;
  options.kept = 250;
  options.shown = 200;
  return options;
}

JudgedCut cutOf(const RegenerativeSystem& machine, double speed, double depth) {
  const auto [multiplier, frequency] =
      makeFloquetSolver(Method::collocation, machine)->at(speed)->motion(depth);
  JudgedCut cut;
  cut.speed = speed;
  cut.depth = depth;
  cut.chatter = multiplier.radius() > 1.0;
  if (cut.chatter) cut.frequency = Measured{std::abs(frequency), 0.01 * std::abs(frequency)};
  return cut;
}

/// [1] Mean distance of the logarithms of the median limit from those of the exact one.
double distance(const ChartLearning& learning, const std::vector<Limit>& exact,
                const std::vector<double>& speeds) {
  const ProbabilityChart chart = learning.chart(speeds, {RANGE.max_depth});
  double sum = 0.0;
  for (std::size_t k = 0; k < speeds.size(); ++k)
    sum += std::abs(
        std::log(std::min(chart.nominal[k], RANGE.max_depth) / std::min(exact[k].depth, RANGE.max_depth)));
  return sum / static_cast<double>(speeds.size());
}

TEST(ChartLearning, FindsTheModeAndTheChartFromChatterFrequencies) {
  const RegenerativeSystem machine = truth();
  std::vector<double> speeds;
  for (int k = 0; k < 40; ++k)
    speeds.push_back(RANGE.speed_low + (RANGE.speed_high - RANGE.speed_low) * k / 39);
  const auto exact = makeSolver(Method::collocation, machine)->limits(speeds, RANGE.max_depth);
  ChartLearning learning(MachinePrior::wide(slot()), RANGE, quick());
  const MachineEstimate before = learning.estimate();
  const double wide = distance(learning, exact, speeds);
  for (int k = 0; k < 5; ++k) {
    const CutProposal next = learning.next();
    learning.add(cutOf(machine, next.speed, next.depth));
  }
  const MachineEstimate after = learning.estimate();
  EXPECT_GT(before.frequency[0].log_std, 0.5);
  // The chatter frequency lies up to 15 % above that of the mode.
  EXPECT_NEAR(after.frequency[0].median, 1480.0, 0.15 * 1480.0);
  EXPECT_LT(after.frequency[0].log_std, 0.5 * before.frequency[0].log_std);
  EXPECT_LT(distance(learning, exact, speeds), 0.6 * wide);

  const auto best = learning.recommended();
  ASSERT_TRUE(best);
  EXPECT_LE(makeFloquetSolver(Method::collocation, machine)->multiplier(best->speed, best->depth).radius(),
            1.0);
  EXPECT_GE(best->stable, 0.95);
}

// Machines drawn from the prior: of the cuts stated as stable with the probability p, the share p is stable.
TEST(ChartLearning, StatesProbabilitiesThatAreObserved) {
  const MachinePrior prior = MachinePrior::wide(slot());
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit;
  const auto speed = [&] {
    return RANGE.speed_low * std::pow(RANGE.speed_high / RANGE.speed_low, unit(random));
  };
  const auto depth = [&] { return RANGE.max_depth * std::pow(0.02, unit(random)); };
  double stated = 0.0, variance = 0.0;
  int stable = 0, likely = 0, likely_stable = 0, unlikely = 0, unlikely_stable = 0;
  for (unsigned k = 0; k < 16; ++k) {
    std::vector<double> at;
    for (std::size_t i = 0; i < prior.coordinates(); ++i) at.push_back(normal(random));
    const RegenerativeSystem machine = prior.machine(at);
    LearningOptions options = quick();
    options.candidates = 1000;
    options.kept = 200;
    options.seed = k;
    ChartLearning learning(prior, RANGE, options);
    for (int cut = 0; cut < 2; ++cut) learning.add(cutOf(machine, speed(), depth()));
    const auto solver = makeFloquetSolver(Method::collocation, machine);
    for (int point = 0; point < 6; ++point) {
      const double n = speed(), b = depth();
      const double p = 1.0 - learning.chart({n}, {b}).probability[0][0];
      const bool is_stable = solver->multiplier(n, b).radius() <= 1.0;
      stated += p;
      variance += p * (1.0 - p);
      stable += is_stable;
      (p > 0.8 ? likely : unlikely) += p > 0.8 || p < 0.2;
      if (is_stable) (p > 0.8 ? likely_stable : unlikely_stable) += p > 0.8 || p < 0.2;
    }
  }
  // Points of one machine depend on each other: three standard deviations of six points that agree.
  EXPECT_NEAR(stable, stated, 3.0 * std::sqrt(6.0 * variance));
  ASSERT_GT(likely, 5);
  ASSERT_GT(unlikely, 5);
  EXPECT_GT(likely_stable, 0.75 * likely);
  EXPECT_LT(unlikely_stable, 0.25 * unlikely);
}

TEST(ChartLearning, ProbabilityOfChatterGrowsWithTheDepth) {
  ChartLearning learning(MachinePrior::wide(slot()), RANGE, quick());
  learning.add(cutOf(truth(), radPerSecFromRpm(9000.0), 2.0 * MM));
  std::vector<double> depths;
  for (int k = 1; k <= 20; ++k) depths.push_back(0.5 * MM * k);
  const ProbabilityChart chart =
      learning.chart({radPerSecFromRpm(7000.0), radPerSecFromRpm(9000.0), radPerSecFromRpm(14000.0)}, depths);
  for (const auto& column : chart.probability)
    for (std::size_t d = 0; d < column.size(); ++d) {
      EXPECT_GE(column[d], 0.0);
      EXPECT_LE(column[d], 1.0 + 1e-9);
      EXPECT_GE(column[d], d > 0 ? column[d - 1] : 0.0);
    }
}

TEST(ChartLearning, ProposesACutWithinTheRangeBeforeTheFirst) {
  const ChartLearning learning(MachinePrior::wide(slot()), RANGE, quick());
  const CutProposal next = learning.next();
  EXPECT_GE(next.speed, RANGE.speed_low * (1.0 - 1e-9));
  EXPECT_LE(next.speed, RANGE.speed_high * (1.0 + 1e-9));
  EXPECT_GT(next.depth, 0.0);
  EXPECT_LE(next.depth, RANGE.max_depth);
  EXPECT_GT(next.stable, 0.0);
  EXPECT_LT(next.stable, 1.0);
}

TEST(ChartLearning, KeepsASensibleChartWhenCutsContradict) {
  ChartLearning learning(MachinePrior::wide(slot()), RANGE, quick());
  JudgedCut cut;
  cut.speed = radPerSecFromRpm(9000.0);
  cut.depth = 1.0 * MM;
  for (const bool chatter : {true, false, true, false}) {
    cut.chatter = chatter;
    learning.add(cut);
  }
  const double p = learning.chart({cut.speed}, {cut.depth}).probability[0][0];
  EXPECT_GT(p, 0.2);  // about one half
  EXPECT_LT(p, 0.8);
}

TEST(ChartLearning, RecommendsAtLeastTheDeepestOfStableCuts) {
  ChartLearning learning(MachinePrior::wide(slot()), RANGE, quick());
  JudgedCut cut;
  cut.speed = radPerSecFromRpm(17000.0);
  double before = learning.chart({cut.speed}, {6.0 * MM}).probability[0][0];
  for (const double depth : {1.0, 3.0, 6.0}) {
    cut.depth = depth * MM;
    learning.add(cut);
  }
  EXPECT_LT(learning.chart({cut.speed}, {6.0 * MM}).probability[0][0], 0.5 * before);
  const auto best = learning.recommended();
  ASSERT_TRUE(best);
  EXPECT_GE(best->removal(), cut.speed * cut.depth * (1.0 - 1e-9));
  EXPECT_NEAR(learning.judge(cut.speed, cut.depth).stable, 1.0 - LearningOptions{}.wrong, 1e-9);
}

TEST(ChartLearning, StartsFromAModelWithItsDeviations) {
  MachineModel model;
  Mode mode;
  mode.frequency = 1450.0;
  mode.damping_ratio = 0.03;
  mode.gain = 1.0 / 1.5e7;
  mode.frequency_std = 14.5;
  mode.damping_ratio_std = 0.003;
  mode.gain_std = 0.1 * mode.gain;
  model.tool_tip.x.modes = model.tool_tip.y.modes = {mode};
  const ChartLearning learning(MachinePrior::about(model, slot()), RANGE, quick());
  const MachineEstimate found = learning.estimate();
  EXPECT_NEAR(found.frequency[0].median, 1450.0, 10.0);  // 14.5 Hz / sqrt(200 machines), four times
  EXPECT_NEAR(found.frequency[0].log_std, 0.01, 0.003);
  EXPECT_NEAR(found.stiffness[1].log_std, 0.1, 0.03);
  EXPECT_THROW(MachinePrior::about(MachineModel{}, slot()), Error);
}

TEST(ChartLearning, RefusesImpossibleInput) {
  const MachinePrior prior = MachinePrior::wide(slot());
  EXPECT_THROW(ChartLearning(prior, {100.0, 50.0, 1e-3}), Error);
  EXPECT_THROW(ChartLearning(prior, {100.0, 500.0, 0.0}), Error);
  LearningOptions options = quick();
  options.risk = 0.01;  // below the probability of a wrong verdict
  EXPECT_THROW(ChartLearning(prior, RANGE, options), Error);
  ChartLearning learning(prior, RANGE, quick());
  EXPECT_THROW(learning.add({0.0, 1e-3, false}), Error);
  EXPECT_THROW(learning.add({100.0, -1e-3, false}), Error);
}

TEST(JudgedCuts, ReadsChatterFrequencyAndCoefficient) {
  const TemporaryFolder folder;
  const auto written = [&](const std::string& rows) {
    std::ofstream(folder.file("cuts.csv"))
        << "rpm,depth_mm,verdict,chatter_hz,chatter_std_hz,kt_n_per_mm2,kt_std_n_per_mm2\n"
        << rows;
    return folder.file("cuts.csv");
  };
  const auto cuts = readJudgedCuts(written("6000,2,chatter,1500,15,800,80\n6000,1,stable,,,,\n"));
  ASSERT_EQ(cuts.size(), 2u);
  EXPECT_DOUBLE_EQ(cuts[0].frequency->value, 1500.0);
  EXPECT_DOUBLE_EQ(cuts[0].frequency->std_dev, 15.0);
  EXPECT_DOUBLE_EQ(cuts[0].kt->value, 8e8);
  EXPECT_FALSE(cuts[1].frequency);
  for (const char* bad : {"6000,2,stable,1500,,,\n", "6000,2,chatter,,15,,\n", "6000,2,chatter,,,800,\n",
                          "6000,2,chatter,-3,,,\n", "6000,2,loud,,,,\n"})
    EXPECT_THROW(readJudgedCuts(written(bad)), Error) << bad;
}

}  // namespace
}  // namespace smartmill::stability
