#include "smartmill_core/math/linear_algebra.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>

#include <gtest/gtest.h>

#include "smartmill_core/math/angle.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using units::PI;
using units::TWO_PI;

TEST(Angle, IsWrappedIntoOneRevolution) {
  EXPECT_EQ(wrapped(0.0), 0.0);
  EXPECT_EQ(wrapped(1.5), 1.5);
  EXPECT_EQ(wrapped(TWO_PI), 0.0);
  EXPECT_NEAR(wrapped(-0.5), TWO_PI - 0.5, 1e-15);
  EXPECT_NEAR(wrapped(1000.0 * TWO_PI + 3.0), 3.0, 1e-11);
  EXPECT_NEAR(wrapped(-1000.0 * TWO_PI - 3.0), TWO_PI - 3.0, 1e-11);
}

// Near whole revolutions rounding goes either way; every result must satisfy 0 <= angle < 2 pi.
TEST(Angle, StaysInRangeNearWholeRevolutions) {
  for (int turns = -2000; turns <= 2000; ++turns) {
    const double at = turns * TWO_PI;
    for (const double angle : {at, std::nextafter(at, -1e9), std::nextafter(at, 1e9), at - 1e-18}) {
      const double in = wrapped(angle);
      ASSERT_GE(in, 0.0) << angle;
      ASSERT_LT(in, TWO_PI) << angle;
      ASSERT_NEAR(std::remainder(in - angle, TWO_PI), 0.0, 1e-11) << angle;
    }
  }
}

MatrixXd example() {
  MatrixXd a(3, 3);
  a << 4, 1, -2, 1, 3, 0.5, -2, 0.5, 5;
  return a;
}

MatrixXcd complexExample() {
  MatrixXcd a = example().cast<Complex>();
  a(0, 1) += Complex(0.0, 1.0);
  a(1, 0) -= Complex(0.0, 1.0);
  a(1, 2) += Complex(0.0, -0.3);
  a(2, 1) -= Complex(0.0, -0.3);
  return a;
}

TEST(LinearAlgebra, SolvesLinearEquations) {
  const VectorXd b = VectorXd::LinSpaced(3, 1.0, 2.0);
  const MatrixXd a = example();
  MatrixXd skew = a;
  skew(0, 2) = 7.0;
  EXPECT_LT((skew * linear::solve(skew, b) - b).norm(), 1e-14);
  EXPECT_LT((skew * linear::inverse(skew) - MatrixXd::Identity(3, 3)).norm(), 1e-14);
  EXPECT_LT((a * linear::solveSymmetric(a, b) - b).norm(), 1e-14);
  EXPECT_LT((a * linear::inverseSymmetric(a) - MatrixXd::Identity(3, 3)).norm(), 1e-14);
  const MatrixXcd c = complexExample();
  const Eigen::VectorXcd d = b.cast<Complex>() * Complex(1.0, 2.0);
  EXPECT_LT((c * linear::solve(c, d) - d).norm(), 1e-14);
  EXPECT_LT((c * linear::solveSymmetric(c, d) - d).norm(), 1e-14);
  EXPECT_LT((c * linear::inverse(c) - MatrixXcd::Identity(3, 3)).norm(), 1e-14);
  EXPECT_LT((c * linear::inverseSymmetric(c) - MatrixXcd::Identity(3, 3)).norm(), 1e-14);
}

TEST(LinearAlgebra, FactorsASymmetricMatrix) {
  const VectorXd b = VectorXd::LinSpaced(3, 1.0, 2.0);
  const linear::SymmetricRoot made = linear::symmetricRoot(example(), b);
  EXPECT_LT((made.root.transpose() * made.root - example()).norm(), 1e-14);
  EXPECT_LT((made.root.transpose() * made.along - b).norm(), 1e-14);
  // A singular direction gives a zero row of the root.
  MatrixXd singular = MatrixXd::Zero(2, 2);
  singular << 1.0, 2.0, 2.0, 4.0;
  const linear::SymmetricRoot flat = linear::symmetricRoot(singular, VectorXd::Zero(2));
  EXPECT_LT((flat.root.transpose() * flat.root - singular).norm(), 1e-14);
  EXPECT_EQ(flat.along.norm(), 0.0);
}

// A line through collinear points is exact; two equal columns have rank one.
TEST(LinearAlgebra, FindsLeastSquares) {
  MatrixXd a(4, 2);
  a << 1, 0, 1, 1, 1, 2, 1, 3;
  const VectorXd y = 2.0 * a.col(0) - 0.5 * a.col(1);
  const linear::LeastSquares line = linear::leastSquares(a, y);
  EXPECT_EQ(line.rank, 2);
  EXPECT_NEAR(line.x(0, 0), 2.0, 1e-14);
  EXPECT_NEAR(line.x(1, 0), -0.5, 1e-14);
  a.col(0) = a.col(1);
  EXPECT_EQ(linear::leastSquares(a, y).rank, 1);
  // With equal columns the solution of minimum norm has equal elements.
  const VectorXd least = linear::leastNorm(a, y);
  EXPECT_NEAR(least[0], least[1], 1e-14);
  EXPECT_NEAR(least[0], a.col(0).dot(y.col(0)) / a.col(0).squaredNorm() / 2.0, 1e-14);
  const MatrixXd r = linear::triangleOf(a);
  EXPECT_LT((r.transpose() * r - a.transpose() * a).norm(), 1e-13);
  EXPECT_EQ(r(1, 0), 0.0);
}

TEST(LinearAlgebra, FindsEigenvaluesAndSingularValues) {
  // Rotation by 0.3: exp(+-0.3 i); singular values 1.
  MatrixXd turn(2, 2);
  turn << std::cos(0.3), -std::sin(0.3), std::sin(0.3), std::cos(0.3);
  const Eigen::VectorXcd values = linear::eigenvalues(turn);
  EXPECT_NEAR(std::abs(std::arg(values[0])), 0.3, 1e-14);
  EXPECT_NEAR(std::abs(values[0] - std::conj(values[1])), 0.0, 1e-14);
  EXPECT_LT((linear::singularValues(turn) - VectorXd::Ones(2)).norm(), 1e-14);
  const linear::Eigensystem system = linear::eigensystem(turn);
  EXPECT_LT((turn.cast<Complex>() * system.vectors - system.vectors * system.values.asDiagonal()).norm(),
            1e-14);
  const linear::SymmetricEigensystem own = linear::symmetricEigensystem(example());
  EXPECT_LT((own.vectors * own.values.asDiagonal() * own.vectors.transpose() - example()).norm(), 1e-13);
  EXPECT_LE(own.values[0], own.values[1]);
  // The singular values of a positive definite Hermitian matrix are its eigenvalues.
  const MatrixXcd c = complexExample();
  Eigen::VectorXd real = linear::eigenvalues(c).real();
  std::sort(real.data(), real.data() + real.size(), std::greater<>());
  EXPECT_LT((real - linear::singularValues(c)).norm(), 1e-13);
}

TEST(LinearAlgebra, DecomposesAMatrix) {
  MatrixXd a(2, 3);
  a << 1, 2, 3, -1, 0.5, 2;
  const linear::Svd thin = linear::svd(a), full = linear::svd(a, true);
  EXPECT_LT((thin.u * thin.values.asDiagonal() * thin.v.transpose() - a).norm(), 1e-14);
  EXPECT_EQ(thin.v.cols(), 2);
  EXPECT_EQ(full.v.cols(), 3);
  EXPECT_LT((a * full.v.col(2)).norm(), 1e-14);
}

// exp of a rotation's generator is the rotation; of an empty matrix, an empty matrix.
TEST(LinearAlgebra, ComputesTheExponential) {
  MatrixXd generator(2, 2);
  generator << 0.0, -PI / 6.0, PI / 6.0, 0.0;
  const MatrixXd turn = linear::exponential(generator);
  EXPECT_NEAR(turn(0, 0), std::cos(PI / 6.0), 1e-15);
  EXPECT_NEAR(turn(1, 0), 0.5, 1e-15);
  EXPECT_EQ(linear::exponential(MatrixXd(0, 0)).size(), 0);
}

}  // namespace
}  // namespace smartmill
