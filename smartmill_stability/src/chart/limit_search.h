#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Search and continuation of the first loss of stability over the speeds of a chart.
struct ContinuationOptions {
  std::size_t stride = 10;  ///< [1] least distance of the speeds that are searched from depth zero
  /// [1] First depth of a search over the least first guess, which misses flips.
  double below = 0.6;
  double growth = 1.25;  ///< [1] of the depth in a search: islands of instability are thicker
  /// [1] Relative difference of the chatter frequency within a lobe; it jumps by more between lobes.
  double same_lobe = 0.03;
  /// [1] Largest relative difference of two limits over their first guesses, or of two limits without a
  /// guess, for interpolation between them.
  double similar_ratio = 0.06, similar_depth = 0.3;
  double least_slope = 0.05;  ///< [1] of log(spectral radius) over log(depth) for a prediction
  double near_flip = 0.03;    ///< [waves] distance from a flip lobe at which no speed is interpolated
};
inline constexpr ContinuationOptions CONTINUATION;

/// Whether two numbers differ by at most a relative amount.
inline bool isClose(double a, double b, double share) {
  return std::abs(a - b) <= share * std::min(std::abs(a), std::abs(b));
}

/// Limit at one speed of a chart.
struct LimitKnot {
  static constexpr double NO_LIMIT = std::numeric_limits<double>::infinity();
  double depth = NO_LIMIT;                                      ///< [m]
  double frequency = std::numeric_limits<double>::quiet_NaN();  ///< [Hz]
  double slope = 1.0;  ///< [1] d log(spectral radius) / d log(depth) at the limit
  Kind kind = Kind::none;
  bool solved = false;  ///< false: interpolated
};

/// Finds the first loss of stability at one speed [rad/s].
class LimitSearch {
 public:
  /// @param start [m] first depth of a search from zero @param tolerance [1] relative, of a depth
  LimitSearch(const FloquetSolver& solver, double max_depth, double start, double tolerance)
      : solver_(solver), max_depth_(max_depth), start_(std::min(start, max_depth)), tolerance_(tolerance) {}

  /// From depth zero, in larger steps than FloquetSolver::limit().
  LimitKnot fromZero(double speed) const;
  /// Near a prediction; empty: there is none near it.
  std::optional<LimitKnot> near(double speed, const LimitKnot& guess) const;
  /// Whether some depths up to one are stable.
  bool isStableTo(double speed, double depth) const;
  double maxDepth() const { return max_depth_; }

 private:
  const FloquetSolver& solver_;
  double max_depth_, start_;  // [m]
  double tolerance_;          // [1]
};

}  // namespace smartmill::stability
