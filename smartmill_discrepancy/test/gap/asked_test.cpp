#include "smartmill_discrepancy/gap/asked.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr int TESTS = 10, SAMPLES = 400, VALUES = 3, ORDERS = 5;

/// Lines at orders 1..5 of a spindle [one a revolution of 2 pi / turn samples], of random phase.
Eigen::VectorXd lines(double size, double turn, std::mt19937_64& random) {
  std::uniform_real_distribution<double> phase(0.0, units::TWO_PI);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(SAMPLES);
  for (int order = 1; order <= ORDERS; ++order) {
    const double a = phase(random);
    for (int i = 0; i < SAMPLES; ++i) sum[i] += size * std::sin(order * turn * i + a);
  }
  return sum;
}

/// A linear fit of three values that are zero, to noise and to lines of another cause.
/// @return values over their deviations
Eigen::Vector3d fitted(double left_size, std::mt19937_64& random) {
  Eigen::MatrixXd columns(TESTS * SAMPLES, VALUES);
  Eigen::VectorXd measured(TESTS * SAMPLES);
  std::normal_distribution<double> noise;
  for (int t = 0; t < TESTS; ++t) {
    const double turn = 0.0293 + 0.001 * t;  // [rad] a sample
    for (int k = 0; k < VALUES; ++k)
      columns.col(k).segment(t * SAMPLES, SAMPLES) = lines(1.0 + 0.3 * k, turn, random);
    measured.segment(t * SAMPLES, SAMPLES) = lines(left_size, turn, random);
  }
  for (double& value : measured) value += noise(random);
  const Eigen::MatrixXd influences = columns * (columns.transpose() * columns).inverse();
  const Eigen::Vector3d found = influences.transpose() * measured;
  const Eigen::VectorXd left = measured - columns * found;
  Eigen::Vector3d over;
  for (int k = 0; k < VALUES; ++k) {
    std::vector<AskedTest> tests(TESTS);
    for (int t = 0; t < TESTS; ++t)
      tests[static_cast<std::size_t>(t)].add(influences.col(k).data() + t * SAMPLES,
                                             left.data() + t * SAMPLES, SAMPLES);
    over[k] = found[k] / std::sqrt(varianceOfProducts(tests));
  }
  return over;
}

// What is left at the very lines by which the values are known: noise alone would say too little by far.
TEST(VarianceOfProducts, DeviationsOfFittedValuesAreHonest) {
  for (const double left_size : {0.0, 0.5, 4.0}) {
    std::mt19937_64 random(5);
    Coverage coverage;
    for (int run = 0; run < Coverage::RUNS; ++run) coverage.add(fitted(left_size, random)[run % VALUES], 1.0);
    EXPECT_TRUE(coverage.honest()) << left_size;
  }
}

// Of a test that tells more than all others together the fit leaves next to nothing: products of unit noise
// along columns of unequal squares, the common share taken from them, have on average the variance of noise.
TEST(VarianceOfProducts, AWeightyTestHidesNoScatter) {
  const std::vector<double> squares{100.0, 4.0, 9.0, 1.0};
  std::mt19937_64 random(6);
  std::normal_distribution<double> noise;
  constexpr int RUNS = 20000;
  double mean = 0.0;
  for (int run = 0; run < RUNS; ++run) {
    std::vector<AskedTest> tests;
    for (const double s : squares) tests.push_back({s, std::sqrt(s) * noise(random), 0.0});
    mean += varianceOfProducts(tests) / RUNS;
  }
  EXPECT_NEAR(mean / 114.0, 1.0, 0.03);
}

}  // namespace
}  // namespace smartmill::discrepancy
