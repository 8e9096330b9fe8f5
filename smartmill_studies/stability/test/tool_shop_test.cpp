#include "stability/tool_shop.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using units::PI;
using units::TWO_PI;

// First natural frequency of a slender free beam: (4.730041 / L)^2 / (2 pi) sqrt(E I / (rho A)).
TEST(ToolShop, FreeShaftHasTheFrequencyOfEulerBernoulli) {
  ShaftChain shaft;
  shaft.addShaft(1.0, 0.01, 210e9, 7850.0, 1e-4, 20);
  const double expected = std::pow(4.730041, 2) / TWO_PI * std::sqrt(210e9 * 1e-4 / (16.0 * 7850.0));
  double best = 0.0, largest = 0.0;
  for (double f = 0.9 * expected; f < 1.1 * expected; f += 0.0005 * expected) {
    const double size = std::abs(shaft.receptance(0, 0, f));
    if (size > largest) {
      largest = size;
      best = f;
    }
  }
  EXPECT_NEAR(best, expected, 2e-3 * expected);
}

TEST(ToolShop, ReceptancesAreReciprocalAndRigidAtLowFrequencies) {
  ShaftChain shaft;
  shaft.addShaft(0.1, 0.02, 210e9, 7850.0, 0.003, 8);
  shaft.addJoint(1e8, 2e4, 100.0, 0.1);
  shaft.addShaft(0.1, 0.02, 210e9, 7850.0, 0.003, 8);
  EXPECT_LT(std::abs(shaft.receptance(0, 6, 900.0) - shaft.receptance(6, 0, 900.0)),
            1e-9 * std::abs(shaft.receptance(0, 6, 900.0)));
  const double mass = 7850.0 * 0.25 * PI * 0.02 * 0.02 * 0.2,
               inertia = mass * (0.04 / 12.0 + 0.02 * 0.02 / 16.0);
  EXPECT_NEAR(-std::pow(TWO_PI * 5.0, 2) * shaft.receptance(0, 0, 5.0).real(), 1.0 / mass + 0.01 / inertia,
              5e-3 * 4.0 / mass);
}

TEST(ToolShop, IsTheSameForASeed) {
  ToolShop a(3), b(3), c(4);
  const DrawnTool one = a.drawTool(), other = b.drawTool();
  EXPECT_EQ(one.tip.value, other.tip.value);
  EXPECT_EQ(one.tap.value, other.tap.value);
  EXPECT_NE(one.tip.value, c.drawTool().tip.value);
}

}  // namespace
}  // namespace smartmill::stability
