#pragma once

#include <array>
#include <cmath>

namespace smartmill {

/// Stribeck term of a friction law, breakaway exp(-(speed / stribeck_speed)^2) (effects.md:
/// stribeck_friction).
inline double stribeckFriction(double breakaway, double stribeck_speed, double speed) {
  const double ratio = speed / stribeck_speed;
  return breakaway * std::exp(-ratio * ratio);
}

/// Factor on the friction of a spindle that started cold at time 0 (effects.md: friction_warmup).
/// @param cold_ratio [1] additional friction when cold. @param warmup_time [s] > 0. @param time [s].
inline double warmupFactor(double cold_ratio, double warmup_time, double time) {
  return 1.0 + cold_ratio * std::exp(-time / warmup_time);
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
  /// Of at() with respect to (viscous, coulomb).
  std::array<double, 2> gradient(double speed) const {
    if (speed < zero_below) return {0.0, 0.0};
    return {speed, 1.0};
  }
};

/// Spindle friction with Stribeck and warm-up terms:
///   T_f = [viscous w + coulomb + breakaway exp(-(w / stribeck_speed)^2)] (1 + cold_ratio exp(-t /
///   warmup_time)),
/// zero below `zero_below`; t is the time since the start of the campaign.
struct FrictionLaw : LinearFriction {
  double breakaway = 0.0;       ///< [N m]
  double stribeck_speed = 1.0;  ///< [rad/s] > 0
  double cold_ratio = 0.0;      ///< [1]
  double warmup_time = 1.0;     ///< [s] > 0

  /// [N m] @param time [s] since the start of the campaign.
  double torque(double speed, double time) const {
    return at(speed, stribeckFriction(breakaway, stribeck_speed, speed),
              warmupFactor(cold_ratio, warmup_time, time));
  }
};

}  // namespace smartmill
