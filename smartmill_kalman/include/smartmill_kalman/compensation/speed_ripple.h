#pragma once

#include <cstddef>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/compensation/steady_speed.h"

namespace smartmill::kalman {

struct SpeedRippleOptions {
  double window = 0.2;           ///< [s] shortest; long against the 5 to 20 ms between two readings
  std::size_t min_readings = 8;  ///< of a window: the RMS of fewer is known to no better than a quarter
  /// [tolerance] RMS below which a ripple has ended; a sine that changes by the tolerance has 0.35.
  double release = 0.25;
  /// [RMS] largest change of the line within a window, and of the mean from one window to the next. A run-up
  /// has 6 or more as long as it lasts; 20 readings of a ripple scatter by 0.8.
  double max_change = 3.0;
  double max_deviation =
      4.0;  ///< [RMS] of a reading from the mean: above it the speed changes; a sine has 1.4
};

/// Ripple of the spindle speed: readings that change by more than a tolerance (SteadySpeed), so that samples
/// would pass through, about a steady mean. Consecutive windows of at least one revolution; in two of them
/// the readings change and the means agree, which excludes a run-up. A ripple that has the same phase at
/// every reading is not visible.
///
/// The tolerance is where the estimated speed becomes the better one: the study kalman_reference
/// --speed-ripple (kalman.md).
class SpeedRipple {
 public:
  /// @param tolerance [1] @see CompensationParameters::speed_tolerance
  explicit SpeedRipple(double tolerance, const SpeedRippleOptions& options = {})
      : tolerance_(tolerance), options_(options), steady_(tolerance) {}

  void add(const SpindleAngle& reading);
  /// Whether the mean speed is steady and the readings are not.
  bool isRippling() const { return rippling_; }
  double rms() const { return rms_; }      ///< [1] over the speed, of the last complete window
  double speed() const { return speed_; }  ///< [rad/s] mean of that window
  void reset() { *this = SpeedRipple(tolerance_, options_); }

 private:
  void complete();
  void restart(const SpindleAngle& reading);

  double tolerance_;
  SpeedRippleOptions options_;
  SteadySpeed steady_;
  bool changed_ = false;  // readings of the window, by more than the tolerance
  // Sums over the window, from its first reading on: times [s] and differences of speed [rad/s].
  SpindleAngle first_;
  std::size_t count_ = 0;
  double last_ = 0.0;  // [s]
  double t_ = 0.0, tt_ = 0.0, v_ = 0.0, tv_ = 0.0, vv_ = 0.0;
  double rms_ = 0.0, speed_ = 0.0;
  bool candidate_ = false;  // the last window was steady with a ripple
  bool rippling_ = false;
};

}  // namespace smartmill::kalman
