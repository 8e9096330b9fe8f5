#pragma once

#include <cstddef>

#include <gtest/gtest.h>

namespace smartmill {

/// Errors of estimates divided by their stated standard deviations. For calibrated deviations the mean square
/// is 1; it is larger for deviations stated too small and smaller for inflated ones, and both fail.
class Coverage {
 public:
  /// Required number of independent errors. A calibrated deviation then fails one time in fifteen thousand
  /// (hardly once in the hundred or so checks of all tests), and one that is 1.5 times or two thirds of the
  /// true one passes no more often. The number of runs of a test is fixed in advance, independent of its
  /// result.
  static constexpr int RUNS = 200;
  /// Runs that detect deviations wrong by FACTOR_OF_FEW, where each error is expensive and a study computes
  /// more.
  static constexpr int FEW = 72;
  static constexpr double FACTOR_OF_FEW = 2.0;

  void add(double error, double std_dev);

  std::size_t size() const { return count_; }
  /// Root of the mean square of error over deviation.
  double rms() const;

  /// Whether the root mean square is inside the interval that calibrated deviations leave with probability
  /// 1/30000 on each side (chi-square). Fails also with too few errors to detect deviations that are wrong by
  /// the given factor.
  /// @param independent how many of the errors are independent of each other; 0: all. Estimates of one fit
  /// are dependent.
  /// @param factor of the deviations that must be detectable; above 1.5 only where each error is expensive
  /// and a study computes more
  ::testing::AssertionResult isCalibrated(double independent = 0.0, double factor = 1.5) const;

 private:
  std::size_t count_ = 0;
  double sum_ = 0.0;
};

}  // namespace smartmill
