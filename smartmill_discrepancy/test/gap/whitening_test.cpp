#include "smartmill_discrepancy/gap/whitening.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "smartmill_core/testing/coverage.h"

namespace smartmill::discrepancy {
namespace {

// Correlated noise with innovations of unit variance and a share of the previous sample, stationary from the
// first sample on.
std::vector<double> correlatedNoise(double share, std::size_t size, std::mt19937_64& random) {
  std::normal_distribution<double> noise;
  std::vector<double> values{noise(random) / std::sqrt(1.0 - share * share)};
  while (values.size() < size) values.push_back(share * values.back() + noise(random));
  return values;
}

std::vector<double> white(std::size_t size, std::mt19937_64& random) {
  return correlatedNoise(0.0, size, random);
}

// A mean and a slow wave, where correlated noise is strong.
Eigen::MatrixXd columnsOf(std::size_t size) {
  Eigen::MatrixXd columns(static_cast<Eigen::Index>(size), 2);
  for (Eigen::Index i = 0; i < columns.rows(); ++i) {
    columns(i, 0) = 1.0;
    columns(i, 1) = std::sin(0.01 * static_cast<double>(i));
  }
  return columns;
}

// Linear fit with whitening and its stated standard deviations.
struct WhitenedFit {
  Eigen::Vector2d found, std_dev;
  std::size_t order = 0;
};

WhitenedFit whitenedFit(const Eigen::MatrixXd& columns, const std::vector<double>& measured) {
  const auto size = static_cast<Eigen::Index>(measured.size());
  const Eigen::Map<const Eigen::VectorXd> y(measured.data(), size);
  const Eigen::VectorXd left = y - columns * columns.colPivHouseholderQr().solve(y);
  const Whitening whitening(left.data(), measured.size());
  Eigen::MatrixXd whitened_columns = columns;
  Eigen::VectorXd records = y;
  for (Eigen::Index k = 0; k < whitened_columns.cols(); ++k)
    whitening.apply(whitened_columns.col(k).data(), measured.size());
  whitening.apply(records.data(), measured.size());
  const Eigen::Matrix2d covariance = (whitened_columns.transpose() * whitened_columns).inverse();
  return {covariance * (whitened_columns.transpose() * records), covariance.diagonal().cwiseSqrt(),
          whitening.order()};
}

// Without whitening the deviations would be too small by sqrt((1 + share) / (1 - share)).
TEST(Whitening, DeviationsAreCalibrated) {
  constexpr std::size_t SIZE = 4000;
  const Eigen::MatrixXd columns = columnsOf(SIZE);
  for (const double share : {0.0, 0.6, 0.95}) {
    std::mt19937_64 random(7);
    Coverage level, wave;
    for (int run = 0; run < Coverage::RUNS; ++run) {
      const WhitenedFit w = whitenedFit(columns, correlatedNoise(share, SIZE, random));
      level.add(w.found[0], w.std_dev[0]);
      wave.add(w.found[1], w.std_dev[1]);
    }
    EXPECT_TRUE(level.isCalibrated()) << share;
    EXPECT_TRUE(wave.isCalibrated()) << share;
  }
}

// The variance of a mean with such noise: that of the innovations over (1 - share)^2 and the samples.
TEST(Whitening, DeviationOfAMeanMatchesTheClosedForm) {
  constexpr std::size_t SIZE = 20000;
  constexpr double SHARE = 0.8;
  std::mt19937_64 random(8);
  Eigen::MatrixXd columns = columnsOf(SIZE);
  const WhitenedFit w = whitenedFit(columns, correlatedNoise(SHARE, SIZE, random));
  EXPECT_NEAR(w.std_dev[0], 1.0 / (1.0 - SHARE) / std::sqrt(static_cast<double>(SIZE)), 0.05 * w.std_dev[0]);
}

TEST(Whitening, ResidualIsWhite) {
  std::mt19937_64 random(9);
  std::vector<double> values = correlatedNoise(0.95, 20000, random);
  const Whitening whitening(values.data(), values.size());
  EXPECT_NEAR(whitening.innovation(), 1.0, 0.03);
  whitening.apply(values.data(), values.size());
  double squares = 0.0, next = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    squares += values[i] * values[i];
    if (i > 0) next += values[i] * values[i - 1];
  }
  EXPECT_NEAR(squares / 20000.0, 1.0, 0.03);
  EXPECT_NEAR(next / squares, 0.0, 0.03);
}

// White noise is unchanged except for a few records by chance; noise below the stated level counts as stated.
TEST(Whitening, KeepsWhiteNoise) {
  std::mt19937_64 random(10);
  int changed = 0;
  for (int run = 0; run < 200; ++run) {
    std::vector<double> values = white(2000, random);
    changed += Whitening(values.data(), values.size()).isActive() ? 1 : 0;
    for (double& v : values) v *= 0.5;
    EXPECT_FALSE(Whitening(values.data(), values.size()).isActive());
  }
  EXPECT_LE(changed, 5);
  std::vector<double> values{1.0, 2.0, 3.0};
  Whitening().apply(values.data(), values.size());
  EXPECT_EQ(values, (std::vector<double>{1.0, 2.0, 3.0}));
}

// A few values get at most a variance.
TEST(Whitening, FewValuesGetAVarianceOnly) {
  const std::vector<double> left{10.0, -12.0, 9.0, 11.0, -8.0, 10.0};
  const Whitening whitening(left.data(), left.size());
  EXPECT_TRUE(whitening.isActive());
  EXPECT_EQ(whitening.order(), 0u);
  EXPECT_NEAR(whitening.innovation(), 10.08, 0.01);
}

}  // namespace
}  // namespace smartmill::discrepancy
