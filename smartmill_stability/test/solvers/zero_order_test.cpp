#include "smartmill_stability/solvers/zero_order.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using units::PI;

// Benchmark: 0.03993 kg, 922 Hz, 1.1 % damping, two straight teeth, Kt 6e8, Kr 2e8 N/m2.
ModalModel benchmark() {
  ModalModel model;
  const double w = units::TWO_PI * 922.0;
  model.modes = {{922.0, 0.011, 1.0 / (0.03993 * w * w)}};
  return model;
}

struct Row {
  double rpm, root_mm, table_mm;
};

// root_mm: det[I - 1/2 Kt a (1 - exp(-i w T)) A_0 Phi(i w)] = 0 (eq. 6.10), solved by Newton's method with
// A_0 by numerical quadrature, independent of this code. table_mm: zero-order column of an independent table
// for two degrees of freedom, evaluated on a frequency grid and therefore up to 0.5 % above the root.
void check(const RegenerativeProcess& process, const std::vector<Row>& rows) {
  const ToolTipResponse tool = responseOf(benchmark(), benchmark(), 1.0, 6000.0, 60000);
  std::vector<double> speeds;
  for (const Row& row : rows) speeds.push_back(units::radPerSecFromRpm(row.rpm));
  const StabilityLimit limit = zeroOrderLimit(process, tool, speeds);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_NEAR(limit.depth[i] * 1e3 / rows[i].root_mm, 1.0, 1e-4) << rows[i].rpm << " rpm";
    EXPECT_NEAR(limit.depth[i] * 1e3 / rows[i].table_mm, 1.0, 6e-3) << rows[i].rpm << " rpm";
  }
}

TEST(ZeroOrder, slotting) {
  check({2, 0.0, PI, 6e8, 2e8 / 6e8}, {{6000, 0.04948382, 0.0496},
                                       {10000, 0.07355307, 0.0737},
                                       {15000, 0.11714123, 0.1177},
                                       {20000, 0.06256023, 0.0626}});
}

TEST(ZeroOrder, smallImmersionDownMilling) {
  // Radial depth 0.05 D: the last arccos(1 - 2 x 0.05) of half a revolution.
  const double entry = PI - std::acos(1.0 - 2.0 * 0.05);
  check({2, entry, PI, 6e8, 2e8 / 6e8}, {{6000, 1.42978594, 1.431},
                                         {10000, 1.35010717, 1.351},
                                         {15000, 1.64286105, 1.644},
                                         {20000, 6.84965899, 6.850}});
}

TEST(ZeroOrder, meanDirectionalCoefficientsOfASlot) {
  // Slot: -kr pi, -pi, pi, -kr pi.
  const std::array<double, 4> a = directionalCoefficients({4, 0.0, PI, 1e9, 0.3});
  EXPECT_NEAR(a[0], -0.3 * PI, 1e-12);
  EXPECT_NEAR(a[1], -PI, 1e-12);
  EXPECT_NEAR(a[2], PI, 1e-12);
  EXPECT_NEAR(a[3], -0.3 * PI, 1e-12);
}

TEST(ZeroOrder, chartNeverFallsBelowTheAbsoluteLimit) {
  const RegenerativeProcess process{2, 0.0, PI, 6e8, 2e8 / 6e8};
  const ToolTipResponse tool = responseOf(benchmark(), benchmark(), 1.0, 6000.0, 60000);
  std::vector<double> speeds;
  for (int rpm = 4000; rpm <= 25000; rpm += 50) speeds.push_back(units::radPerSecFromRpm(rpm));
  const StabilityLimit limit = zeroOrderLimit(process, tool, speeds);
  const double absolute = absoluteDepthLimit(process, tool);
  double least = 1.0;
  for (const double depth : limit.depth) {
    EXPECT_GE(depth, absolute * (1.0 - 1e-9));
    least = std::min(least, depth);
  }
  EXPECT_NEAR(least / absolute, 1.0, 1e-3);  // reached at a speed of the grid
}

TEST(ZeroOrder, rigidToolHasNoLimit) {
  const ToolTipResponse tool = responseOf(ModalModel{}, ModalModel{}, 1.0, 1000.0, 100);
  const StabilityLimit limit = zeroOrderLimit({4, 0.0, PI, 1e9, 0.3}, tool, {100.0, 200.0});
  EXPECT_TRUE(std::isinf(limit.depth[0]));
  EXPECT_TRUE(std::isnan(limit.chatter_frequency[0]));
}

TEST(ZeroOrder, refusesInvalidInput) {
  const ToolTipResponse tool = responseOf(benchmark(), benchmark(), 1.0, 2000.0, 100);
  EXPECT_THROW(zeroOrderLimit({0, 0.0, PI, 1e9, 0.3}, tool, {100.0}), Error);
  EXPECT_THROW(zeroOrderLimit({4, PI, 0.0, 1e9, 0.3}, tool, {100.0}), Error);
  EXPECT_THROW(zeroOrderLimit({4, 0.0, PI, 1e9, 0.3}, tool, {100.0, 50.0}), Error);
}

}  // namespace
}  // namespace smartmill::stability
