#pragma once

#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"

namespace smartmill {

/// A reading of the spindle's angle, counted on over full turns.
struct UnwrappedAngle {
  double time, turned, shown;  ///< [s], [rad] counted on, [rad] as it came

  /// The next one, later: its speed tells how many full turns lie between.
  UnwrappedAngle next(const SpindleAngle& angle) const {
    const double expected = turned + angle.speed * (angle.stamp - time);
    const double turns = std::round((expected - angle.angle) / units::TWO_PI);
    return {angle.stamp, std::max(turned, angle.angle + units::TWO_PI * turns), angle.angle};
  }
  /// [rad] at a time between this and a later one.
  double between(const UnwrappedAngle& after, double at) const {
    return turned + (at - time) / (after.time - time) * (after.turned - turned);
  }
};

}  // namespace smartmill
