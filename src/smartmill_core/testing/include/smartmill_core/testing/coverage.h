#pragma once

#include <cstddef>

#include <gtest/gtest.h>

namespace smartmill {

/// Errors of estimates over the standard deviations that the estimates state. Where these are honest, the
/// mean of the squares is 1: stated too small it is larger, inflated it is smaller, and both fail.
class Coverage {
 public:
  void add(double error, double std_dev);

  std::size_t size() const { return count_; }
  /// Root of the mean square of error over deviation.
  double rms() const;

  /// Whether the root mean square lies where chance leaves it in 999 of 1000 tries (chi-square).
  /// @param independent how many of the errors are independent of each other; 0: all. Estimates of one fit
  /// are not.
  /// @param slack by which share a deviation may be wrong for a stated reason (an approximation, a small
  /// sample)
  ::testing::AssertionResult honest(std::size_t independent = 0, double slack = 0.0) const;

 private:
  std::size_t count_ = 0;
  double sum_ = 0.0;
};

}  // namespace smartmill
