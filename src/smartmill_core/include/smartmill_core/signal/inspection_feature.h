#pragma once

#include <limits>
#include <string>

namespace smartmill {

/// @{ Kinds of a feature.
constexpr const char* SLOT_WIDTH = "slot_width";
constexpr const char* STEP_POSITION = "step_position";
/// @}

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
};

}  // namespace smartmill
