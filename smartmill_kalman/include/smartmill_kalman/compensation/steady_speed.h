#pragma once

#include <limits>

#include "smartmill_core/signal/streams.h"

namespace smartmill::kalman {

/// Whether the spindle holds its speed: a relative change by more than a tolerance within 50 ms is a run-up
/// or run-down, during which no harmonic can be followed. Slow drift is steady.
class SteadySpeed {
 public:
  /// @param tolerance [1] @see CompensationParameters::speed_tolerance
  explicit SteadySpeed(double tolerance) : tolerance_(tolerance) {}

  void add(const SpindleAngle& angle);
  bool isSteadyAt(double stamp) const { return stamp >= changing_until_; }  ///< stamp [s]
  void reset() { *this = SteadySpeed(tolerance_); }

 private:
  static constexpr double NEVER = -std::numeric_limits<double>::infinity();

  double tolerance_;
  double reference_ = 0.0;          // [rad/s] speed that changes are measured from; 0: none
  double reference_stamp_ = NEVER;  // [s]
  double changing_until_ = NEVER;   // [s]
};

}  // namespace smartmill::kalman
