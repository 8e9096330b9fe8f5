#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace smartmill::discrepancy {

/// What of a record comes again with the revolution.
struct Repeatability {
  double variance = 0.0;  ///< [unit^2] of the samples about their mean
  double floor =
      0.0;  ///< [unit] RMS of what does not come again: the least that a model of a steady cut leaves
  std::size_t samples = 0;  ///< used
  /// [unit] Level, then cosine and sine of each order of the spindle.
  std::vector<double> lines;

  double repeats() const { return variance > 0.0 ? 1.0 - floor * floor / variance : 0.0; }  ///< [1] share
};

/// Estimated from the record itself: mean and all orders of the spindle below 0.9 of half the sample rate, by
/// least squares; what they leave, over its degrees of freedom. White noise of RMS s has a floor of s.
/// @param values of a steady cut @param angle [rad] of the spindle at each, whole turns may be left out
/// @return nothing for less than LEAST_TURNS turns
std::optional<Repeatability> repeatability(const std::vector<double>& values,
                                           const std::vector<double>& angle);

constexpr double LEAST_TURNS = 5.0;

}  // namespace smartmill::discrepancy
