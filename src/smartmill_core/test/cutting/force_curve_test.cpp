#include "smartmill_core/cutting/force_curve.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace smartmill {
namespace {

constexpr double TOP = 0.3e-3;  // [m]
constexpr int PIECES = 7;

// Greville: with their knots' means of three as coefficients the splines are the straight line x.
double abscissa(int k) {
  double sum = 0.0;
  for (int j = 1; j <= 3; ++j) sum += TOP * std::clamp(k + j - 3, 0, PIECES) / PIECES;
  return sum / 3.0;
}

TEST(CubicSplines, AddUpToOneAndToAStraightLineOfSlopeOne) {
  for (int i = 0; i <= 1000; ++i) {
    const double x = TOP * i / 1000.0;
    const CubicSplines splines(x, TOP, PIECES);
    double sum = 0.0, line = 0.0, flat = 0.0, slope = 0.0;
    for (int k = 0; k < 4; ++k) {
      const auto at = static_cast<std::size_t>(k);
      sum += splines.value[at];
      line += splines.value[at] * abscissa(splines.first + k);
      flat += splines.slope[at] * TOP;
      slope += splines.slope[at] * abscissa(splines.first + k);
    }
    EXPECT_NEAR(sum, 1.0, 1e-14);
    EXPECT_NEAR(line, x, 1e-14 * TOP);
    EXPECT_NEAR(flat, 0.0, 1e-12);
    EXPECT_NEAR(slope, 1.0, 1e-12);
  }
}

// A cubic is in the space of the splines; its coefficients are its blossom at three successive knots.
TEST(ForceCurve, SlopeOfACubicIsExactToTheEndsAndBeyond) {
  ForceCurve curve;
  for (int k = 0; k <= PIECES; ++k) curve.knots.push_back(TOP * k / PIECES);
  const auto knot = [](int k) { return static_cast<double>(std::clamp(k - 3, 0, PIECES)) / PIECES; };
  for (int k = 0; k < PIECES + 3; ++k) curve.value.push_back(5e4 * knot(k + 1) * knot(k + 2) * knot(k + 3));
  for (const double h : {0.0, 0.01e-3, 0.1e-3, 0.2999e-3, TOP}) {
    EXPECT_NEAR(curve.at(h), 5e4 * std::pow(h / TOP, 3), 1e-9) << h;
    EXPECT_NEAR(curve.slope(h), 15e4 * std::pow(h / TOP, 2) / TOP, 1e-4) << h;
  }
  EXPECT_DOUBLE_EQ(curve.slope(2.0 * TOP), curve.slope(TOP));
  EXPECT_NEAR(curve.at(2.0 * TOP), 20e4, 1e-6);
}

}  // namespace
}  // namespace smartmill
