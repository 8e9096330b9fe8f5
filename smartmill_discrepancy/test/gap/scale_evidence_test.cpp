#include "smartmill_discrepancy/gap/scale_evidence.h"

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

/// Lines at orders 1..5 of a spindle [2 pi / step samples per revolution], of random phase.
Eigen::VectorXd lines(double size, double step, std::mt19937_64& random) {
  std::uniform_real_distribution<double> phase(0.0, units::TWO_PI);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(SAMPLES);
  for (int order = 1; order <= ORDERS; ++order) {
    const double a = phase(random);
    for (int i = 0; i < SAMPLES; ++i) sum[i] += size * std::sin(order * step * i + a);
  }
  return sum;
}

/// Linear fit of three values, which are zero, to noise and lines of another cause.
/// @return values over their standard deviations
Eigen::Vector3d fitted(double residual_size, std::mt19937_64& random) {
  Eigen::MatrixXd columns(TESTS * SAMPLES, VALUES);
  Eigen::VectorXd measured(TESTS * SAMPLES);
  std::normal_distribution<double> noise;
  for (int t = 0; t < TESTS; ++t) {
    const double step = 0.0293 + 0.001 * t;  // [rad] per sample
    for (int k = 0; k < VALUES; ++k)
      columns.col(k).segment(t * SAMPLES, SAMPLES) = lines(1.0 + 0.3 * k, step, random);
    measured.segment(t * SAMPLES, SAMPLES) = lines(residual_size, step, random);
  }
  for (double& value : measured) value += noise(random);
  const Eigen::MatrixXd influences = columns * (columns.transpose() * columns).inverse();
  const Eigen::Vector3d found = influences.transpose() * measured;
  const Eigen::VectorXd residual = measured - columns * found;
  Eigen::Vector3d normalised;
  for (int k = 0; k < VALUES; ++k) {
    std::vector<ScaleEvidence> tests(TESTS);
    for (int t = 0; t < TESTS; ++t)
      tests[static_cast<std::size_t>(t)].add(influences.col(k).data() + t * SAMPLES,
                                             residual.data() + t * SAMPLES, SAMPLES);
    normalised[k] = found[k] / std::sqrt(varianceOfProducts(tests));
  }
  return normalised;
}

// A residual at the same lines as the derivatives: noise alone would give far too small deviations.
TEST(VarianceOfProducts, DeviationsOfFittedValuesAreCalibrated) {
  for (const double residual_size : {0.0, 0.5, 4.0}) {
    std::mt19937_64 random(5);
    Coverage coverage;
    for (int run = 0; run < Coverage::RUNS; ++run)
      coverage.add(fitted(residual_size, random)[run % VALUES], 1.0);
    EXPECT_TRUE(coverage.isCalibrated()) << residual_size;
  }
}

// A test that dominates the fit has a small residual: products of unit noise with columns of unequal squares
// have on average the variance of noise.
TEST(VarianceOfProducts, ADominantTestHidesNoScatter) {
  const std::vector<double> squares{100.0, 4.0, 9.0, 1.0};
  std::mt19937_64 random(6);
  std::normal_distribution<double> noise;
  constexpr int RUNS = 20000;
  double mean = 0.0;
  for (int run = 0; run < RUNS; ++run) {
    std::vector<ScaleEvidence> tests;
    for (const double s : squares) tests.push_back({s, std::sqrt(s) * noise(random), 0.0});
    mean += varianceOfProducts(tests) / RUNS;
  }
  EXPECT_NEAR(mean / 114.0, 1.0, 0.03);
}

}  // namespace
}  // namespace smartmill::discrepancy
