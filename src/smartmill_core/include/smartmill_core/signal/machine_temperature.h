#pragma once

#include <limits>
#include <string>
#include <vector>

namespace smartmill {

constexpr double ZERO_CELSIUS = 273.15;  ///< [K] controllers report degrees Celsius

/// Temperatures of the motors as the controller reports them (topic machine/temperature). NaN: not reported.
struct MachineTemperature {
  double stamp = 0.0;  ///< [s]
  std::vector<std::string> axes;
  std::vector<double> axis_motor, axis_encoder;                     ///< [K] order of axes
  double spindle_motor = std::numeric_limits<double>::quiet_NaN();  ///< [K]
};

}  // namespace smartmill
