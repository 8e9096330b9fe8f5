#pragma once

#include <deque>
#include <limits>
#include <optional>

#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Spindle angle at any time, from readings that may arrive late: interpolated linearly between two readings,
/// extrapolated with the speed of the nearest one.
class AngleTrack {
 public:
  /// A backward jump of time resets the track.
  void push(const SpindleAngle& reading);
  /// [rad] 0 .. 2 pi; empty: no reading within REACH
  std::optional<double> at(double time) const;
  /// [s] stamp of the newest reading; -inf: none
  double newest() const {
    return readings_.empty() ? -std::numeric_limits<double>::infinity() : readings_.back().stamp;
  }
  /// [rad/s] of the newest reading; 0: none
  double speed() const { return readings_.empty() ? 0.0 : readings_.back().speed; }

  static constexpr double HISTORY = 5.0;  ///< [s] of stored readings
  static constexpr double REACH = 0.5;    ///< [s] beyond the nearest reading

 private:
  std::deque<SpindleAngle> readings_;
};

}  // namespace smartmill
