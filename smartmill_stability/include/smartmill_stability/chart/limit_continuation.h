#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Accuracy of limits by continuation.
struct ContinuationAccuracy {
  int nodes = 0;             ///< [1] of a collocation element
  double tolerance = 0.0;    ///< [1] relative, of a solved depth
  double straight = 0.0;     ///< [1] relative error of a prediction that permits interpolation
  std::size_t searched = 0;  ///< [1] least number of speeds that are searched from depth zero
  std::size_t longest = 0;   ///< [1] speeds from one solved speed to the next across interpolated ones
  int lines = 0;             ///< [1] of the zero-order solution on either side of each mode

  /// A picture that follows a slider: a solved depth is right to less than a pixel.
  static constexpr ContinuationAccuracy ofPicture() { return {8, 1e-3, 0.01, 30, 100, 60}; }
  /// A published chart: recommended cuts and pockets are read from it.
  static constexpr ContinuationAccuracy ofChart() { return {10, 1e-4, 0.001, 60, 2, 400}; }
};

/// Limits at two or more ascending speeds by continuation: evenly spaced speeds are searched from depth zero
/// by collocation; the speeds between start from a prediction by their neighbours and the zero-order
/// solution, and are interpolated where the prediction is right. Where the lobe changes, every speed is
/// solved.
StabilityLimit limitsByContinuation(const RegenerativeSystem& system, const std::vector<double>& speeds,
                                    double max_depth,
                                    const ContinuationAccuracy& accuracy = ContinuationAccuracy::ofPicture());

}  // namespace smartmill::stability
