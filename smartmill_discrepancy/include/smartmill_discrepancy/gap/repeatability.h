#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// Part of a record that is synchronous with the spindle.
struct Repeatability {
  double variance = 0.0;  ///< [unit^2] of the samples about their mean
  double floor =
      0.0;  ///< [unit] RMS of the asynchronous part: the smallest residual of any model of a steady cut
  std::size_t samples = 0;  ///< number of samples
  /// [unit] mean, then cosine and sine of each order of the spindle
  std::vector<double> lines;
};

/// Least-squares estimate from the record itself: mean and all orders of the spindle up to a share of the
/// Nyquist frequency; the floor is the RMS of their residual over its degrees of freedom. White noise of RMS
/// s has a floor of s.
/// @param values of a steady cut @param angle [rad] of the spindle at each sample, whole revolutions may be
/// omitted
/// @return nothing below the minimum of revolutions
std::optional<Repeatability> repeatability(const std::vector<double>& values,
                                           const std::vector<double>& angle);

/// Of the steady part of a cut. @param values one per sample of the record
/// @return nothing without spindle angle or enough revolutions
std::optional<Repeatability> steadyRepeatability(const TestData& test, const std::vector<double>& values);

}  // namespace smartmill::discrepancy
