#include "smartmill_core/testing/coverage.h"

#include <algorithm>
#include <cmath>

namespace smartmill {
namespace {

/// Quantile of chi-square over its degrees of freedom, after Wilson & Hilferty (1931): within 2 % from 5
/// degrees on.
/// @param z quantile of the normal distribution
double chiSquareShare(double freedom, double z) {
  const double variance = 2.0 / (9.0 * freedom);
  const double root = std::max(0.0, 1.0 - variance + z * std::sqrt(variance));
  return root * root * root;
}

}  // namespace

void Coverage::add(double error, double std_dev) {
  const double z = error / std_dev;
  sum_ += z * z;
  ++count_;
}

double Coverage::rms() const {
  return std::sqrt(sum_ / static_cast<double>(count_));
}

::testing::AssertionResult Coverage::isCalibrated(double independent, double factor) const {
  constexpr double Z = 4.0;  // quantile of the normal distribution, two-sided
  const double freedom = independent > 0.0 ? independent : static_cast<double>(count_);
  const double least = std::sqrt(chiSquareShare(freedom, -Z)), most = std::sqrt(chiSquareShare(freedom, Z));
  if (!(most <= factor * least))
    return ::testing::AssertionFailure()
           << freedom << " independent errors do not detect a factor of " << factor;
  const bool good = rms() >= least && rms() <= most;  // false for NaN
  return (good ? ::testing::AssertionSuccess() : ::testing::AssertionFailure())
         << "error over stated deviation has RMS " << rms() << " over " << count_ << " estimates, expected "
         << least << " .. " << most;
}

}  // namespace smartmill
