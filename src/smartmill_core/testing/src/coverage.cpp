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

::testing::AssertionResult Coverage::honest(std::size_t independent, double slack) const {
  constexpr double Z = 3.29;  // 999 of 1000, both sides
  const auto freedom = static_cast<double>(independent == 0 ? count_ : independent);
  const double least = std::sqrt(chiSquareShare(freedom, -Z)) / (1.0 + slack);
  const double most = std::sqrt(chiSquareShare(freedom, Z)) * (1.0 + slack);
  const bool good = rms() >= least && rms() <= most;  // NaN is not good
  return (good ? ::testing::AssertionSuccess() : ::testing::AssertionFailure())
         << "error over stated deviation has RMS " << rms() << " over " << count_ << " estimates, honest is "
         << least << " .. " << most;
}

}  // namespace smartmill
