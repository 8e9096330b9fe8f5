#pragma once

#include <cmath>
#include <limits>
#include <string>

namespace smartmill {

/// @{ Kinds of a feature.
constexpr const char* SLOT_WIDTH = "slot_width";
constexpr const char* STEP_POSITION = "step_position";
/// @}

/// [m] A dimension at 20 deg C (ISO 1), at which drawings hold. @param temperature [K] of the part during the
/// inspection and @param expansion [1/K] of its material; NaN: it had 20 deg C
inline double dimensionAtReference(double measured, double temperature, double expansion) {
  constexpr double REFERENCE = 293.15;  // [K]
  const bool is_stated = std::isfinite(temperature) && std::isfinite(expansion);
  return is_stated ? measured / (1.0 + expansion * (temperature - REFERENCE)) : measured;
}

/// Dimension of a machined part as its inspection gave it (topic inspection/feature). NaN: not stated.
struct InspectionFeature {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

  double stamp = 0.0;     ///< [s] of the inspection; 0: not stated
  std::string condition;  ///< name of the cut that made it
  std::string kind;       ///< SLOT_WIDTH or STEP_POSITION
  std::string direction;  ///< x, y, z: axis of the machine along which it was measured
  double nominal =
      UNKNOWN;  ///< [m] expected of a tool of its stated diameter on a machine that does not grow
  double measured = UNKNOWN;             ///< [m]
  double std_dev = UNKNOWN;              ///< [m] of measured
  double cut_time = UNKNOWN;             ///< [s] time of the cut
  double machine_temperature = UNKNOWN;  ///< [K] of the motor during the cut
  double part_temperature = UNKNOWN;     ///< [K] during the inspection; NaN: 20 deg C
  double part_expansion = UNKNOWN;       ///< [1/K] of the part's material

  /// [m] of the measured value at 20 deg C from nominal.
  double deviation() const {
    return dimensionAtReference(measured, part_temperature, part_expansion) - nominal;
  }
};

}  // namespace smartmill
