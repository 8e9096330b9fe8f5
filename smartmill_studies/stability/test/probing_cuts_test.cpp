#include "stability/probing_cuts.h"

#include <random>

#include <gtest/gtest.h>

namespace smartmill::stability {
namespace {

UntappedMachine drawn() {
  std::mt19937_64 random(3);
  return drawUntappedMachine(random);
}

TEST(ProbingCuts, TheMostRemovalLiesOnTheExactBoundaryOrAtTheLargestDepth) {
  const UntappedMachine machine = drawn();
  const CutProposal most = mostRemoval(machine);
  const auto here = makeFloquetSolver(Method::collocation, machine.system())->at(most.speed);
  EXPECT_LE(here->multiplier(0.98 * most.depth).radius(), 1.0);
  EXPECT_GT(most.depth, 0.0);
  EXPECT_LE(most.depth, machine.range.max_depth);
  if (most.depth < machine.range.max_depth) {
    EXPECT_GT(here->multiplier(1.02 * most.depth).radius(), 1.0);
  }
}

TEST(ProbingCuts, TheMachineReportsTheLoadMeterOnceAndTheFrequencyOfChatterOnly) {
  const UntappedMachine machine = drawn();
  ProbedMachine cutting(machine, 1);
  const double speed = machine.range.speed_high;
  const JudgedCut light = cutting.at(speed, 1e-6), deep = cutting.at(speed, machine.range.max_depth);
  EXPECT_FALSE(light.chatter);
  EXPECT_TRUE(light.kt);
  EXPECT_FALSE(light.frequency);
  EXPECT_TRUE(deep.chatter);
  EXPECT_TRUE(deep.frequency);
  EXPECT_FALSE(deep.kt);
}

TEST(ProbingCuts, RecommendsAStableCutThatRemovesAtMostWhatTheChartAllows) {
  const UntappedMachine machine = drawn();
  LearningOptions options;
  options.candidates = 2000;
  options.kept = 200;
  const ProbingResult result = probe(machine, 4, options, 1);
  ASSERT_EQ(result.cuts.size(), 4u);
  ASSERT_TRUE(result.recommended);
  EXPECT_TRUE(result.stable);
  EXPECT_GT(result.removal, 0.1);
  EXPECT_LT(result.removal, 1.02);  // speeds of the exact chart are 0.4 % apart
}

}  // namespace
}  // namespace smartmill::stability
