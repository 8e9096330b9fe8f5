#pragma once

#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"

namespace smartmill {

/// A sample of the spindle angle, unwrapped over revolutions.
struct UnwrappedAngle {
  double time, turned, measured;  ///< [s], [rad] unwrapped, [rad] as measured

  /// The next sample in time: its speed determines the number of full revolutions in between.
  UnwrappedAngle next(const SpindleAngle& angle) const {
    const double expected = turned + angle.speed * (angle.stamp - time);
    const double turns = std::round((expected - angle.angle) / units::TWO_PI);
    return {angle.stamp, std::max(turned, angle.angle + units::TWO_PI * turns), angle.angle};
  }
  /// [rad] interpolated at a time between this and a later sample.
  double between(const UnwrappedAngle& after, double at) const {
    return turned + (at - time) / (after.time - time) * (after.turned - turned);
  }
};

}  // namespace smartmill
