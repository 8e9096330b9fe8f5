#pragma once

#include <cstddef>

#include <gtest/gtest.h>

namespace smartmill {

/// Errors of estimates over the standard deviations that the estimates state. Where these are honest, the
/// mean of the squares is 1: stated too small it is larger, inflated it is smaller, and both fail.
class Coverage {
 public:
  /// Independent errors that are due: an honest deviation then fails one time in thirty thousand (of some
  /// hundred such looks in all tests hardly one), and one that is half as much again as the true one, or two
  /// thirds of it, passes no more often. How many runs a test makes is fixed by this, not by what it finds.
  static constexpr int RUNS = 200;

  void add(double error, double std_dev);

  std::size_t size() const { return count_; }
  /// Root of the mean square of error over deviation.
  double rms() const;

  /// Whether the root mean square lies where chance leaves it but one time in thirty thousand
  /// (chi-square). Too few
  /// errors to tell deviations that are wrong by that factor are no evidence and fail.
  /// @param independent how many of the errors are independent of each other; 0: all. Estimates of one fit
  /// are not.
  /// @param told factor that must show; above 1.5 only where each error costs much and a study makes more
  ::testing::AssertionResult honest(double independent = 0.0, double told = 1.5) const;

 private:
  std::size_t count_ = 0;
  double sum_ = 0.0;
};

}  // namespace smartmill
