#pragma once

#include <cmath>

namespace smartmill {

/// Stribeck term of a friction law, breakaway exp(-(speed / stribeck_speed)^2) (effects.md:
/// stribeck_friction).
inline double stribeckFriction(double breakaway, double stribeck_speed, double speed) {
  const double ratio = speed / stribeck_speed;
  return breakaway * std::exp(-ratio * ratio);
}

/// Friction of a spindle (torque [N m] over speed [rad/s]) or of a slide (force [N] over velocity [m/s]):
/// viscous and Coulomb friction, zero below a speed (Dunwoody eq. 3.3, 3.11).
struct LinearFriction {
  double viscous = 0.0;     ///< [N m s/rad] or [N s/m]
  double coulomb = 0.0;     ///< [N m] or [N], any sign
  double zero_below = 0.0;  ///< [rad/s] or [m/s]

  /// Friction at a speed >= 0. @param extra further terms, for example Stribeck friction. @param factor on
  /// all terms (warm-up).
  double at(double speed, double extra = 0.0, double factor = 1.0) const {
    return speed < zero_below ? 0.0 : factor * (viscous * speed + coulomb + extra);
  }
};

}  // namespace smartmill
