#include "smartmill_core/fit/bounded_quadratic.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace smartmill::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double INFINITE = std::numeric_limits<double>::infinity();

// Two coupled unknowns: with the first at its bound, the second changes.
TEST(MinimiseWithin, solvesForTheRestWithUnknownsAtBounds) {
  MatrixXd h(2, 2);
  h << 2.0, 1.0, 1.0, 2.0;
  const VectorXd b = (VectorXd(2) << 6.0, 3.0).finished();  // without bounds: (3, 0)
  const VectorXd open = VectorXd::Constant(2, INFINITE);
  const VectorXd freely = minimiseWithin(h, b, -open, open);
  EXPECT_NEAR(freely[0], 3.0, 1e-12);
  EXPECT_NEAR(freely[1], 0.0, 1e-12);
  const VectorXd bound = minimiseWithin(h, b, -open, VectorXd::Constant(2, 1.0));
  EXPECT_DOUBLE_EQ(bound[0], 1.0);
  EXPECT_NEAR(bound[1], 1.0, 1e-12);  // (3 - 1) / 2, which is also the bound
  const VectorXd held =
      minimiseWithin(h, b, (VectorXd(2) << 2.0, -9.0).finished(), (VectorXd(2) << 2.0, 9.0).finished());
  EXPECT_DOUBLE_EQ(held[0], 2.0);
  EXPECT_NEAR(held[1], 0.5, 1e-12);
}

TEST(MinimiseWithin, acceptsAnEmptyProblem) {
  EXPECT_EQ(minimiseWithin({}, {}, {}, {}).size(), 0);
}

// Karush-Kuhn-Tucker conditions: the gradient vanishes for free elements and points outwards at a bound. Half
// of the problems are ill-conditioned (1e8), with bounds on all elements.
TEST(MinimiseWithin, satisfiesTheKarushKuhnTuckerConditions) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> width(0.0, 2.0);
  for (int trial = 0; trial < 200; ++trial) {
    const Index n = 1 + trial % 40;
    MatrixXd a(n + 5, n);
    for (double& v : a.reshaped()) v = normal(random);
    if (trial % 2 == 1 && n > 1) a.col(0) = a.col(1) + 1e-4 * a.col(0);
    const MatrixXd h = a.transpose() * a;
    VectorXd b(n), low(n), high(n);
    for (Index i = 0; i < n; ++i) {
      b[i] = 10.0 * normal(random);
      low[i] = -width(random);
      high[i] = low[i] + width(random);
    }
    const VectorXd x = minimiseWithin(h, b, low, high), slope = b - h * x;
    for (Index i = 0; i < n; ++i) {
      const double outwards = 1e-7 * std::sqrt(h(i, i)) * b.norm();
      EXPECT_GE(x[i], low[i]);
      EXPECT_LE(x[i], high[i]);
      EXPECT_TRUE(x[i] == low[i] || slope[i] >= -outwards) << trial << ": " << i;
      EXPECT_TRUE(x[i] == high[i] || slope[i] <= outwards) << trial << ": " << i;
    }
  }
}

}  // namespace
}  // namespace smartmill::fit
