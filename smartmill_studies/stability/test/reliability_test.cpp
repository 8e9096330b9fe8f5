#include "stability/reliability.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::stability {
namespace {

ReliabilityOptions options() {
  ReliabilityOptions o;
  o.speed_low = units::radPerSecFromRpm(9000.0);
  o.speed_high = units::radPerSecFromRpm(20000.0);
  o.max_depth = 10e-3;
  o.machines = 60;
  o.draws = 60;
  o.by_twin = false;
  return o;
}

// Newcombe (1998), table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
TEST(Wilson, publishedIntervals) {
  const int k[] = {81, 15, 0, 1}, n[] = {263, 148, 20, 29};
  const double low[] = {0.2553, 0.0624, 0.0, 0.0061}, high[] = {0.3662, 0.1605, 0.1611, 0.1718};
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(wilson(k[i], n[i])[0], low[i], 6e-5) << i;
    EXPECT_NEAR(wilson(k[i], n[i])[1], high[i], 6e-5) << i;
  }
}

TEST(Reliability, anHonestBeliefIsConfirmedAndAFalseOneIsNot) {
  const MachineModel model = readMachineModel(MODEL_FILE);
  const RegenerativeSystem system = systemOf(model, 90.0, 180.0);
  auto points = reliabilityStudy(model, system, options());
  ASSERT_EQ(points.size(), 60u);
  EXPECT_LT(std::abs(reliabilityScore(points, false)), 3.0);
  int count = 0;
  for (const ReliabilityBin& bin : reliabilityBins(points, 4, false)) count += bin.count;
  EXPECT_EQ(count, 60);
  // Overconfident predictions.
  for (ReliabilityPoint& p : points) p.predicted = p.predicted > 0.5 ? 0.999 : 0.001;
  EXPECT_GT(std::abs(reliabilityScore(points, false)), 3.0);
}

TEST(Reliability, refusesWhatCannotBe) {
  const MachineModel model = readMachineModel(MODEL_FILE);
  const RegenerativeSystem system = systemOf(model, 90.0, 180.0);
  ReliabilityOptions o = options();
  o.machines = 0;
  EXPECT_THROW(reliabilityStudy(model, system, o), Error);
  o = options();
  o.speed_low = 0.0;
  EXPECT_THROW(reliabilityStudy(model, system, o), Error);
}

}  // namespace
}  // namespace smartmill::stability
