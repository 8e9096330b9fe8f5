#pragma once

#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill {

/// The angle minus whole revolutions: 0 <= result < 2 pi. Uses integers, since floor() and fmod() are
/// function calls. Valid up to about 1e15 revolutions, within the rounding of the given angle.
inline double wrapped(double angle) {
  const double turns = angle * (1.0 / units::TWO_PI);
  const auto whole = static_cast<long>(turns);
  const double rest =
      angle - static_cast<double>(whole - (turns < static_cast<double>(whole) ? 1 : 0)) * units::TWO_PI;
  // Rounding may leave it slightly outside its range.
  if (rest < 0.0) return rest + units::TWO_PI < units::TWO_PI ? rest + units::TWO_PI : 0.0;
  return rest < units::TWO_PI ? rest : rest - units::TWO_PI;
}

/// [rad] The angle shifted by whole revolutions to within half a revolution of a reference.
inline double nearAngle(double angle, double reference) {
  return angle - units::TWO_PI * std::round((angle - reference) / units::TWO_PI);
}

}  // namespace smartmill
