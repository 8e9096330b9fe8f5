#pragma once

#include <string>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {

/// Points at which FRFs are measured.
constexpr const char* POINT_TOOL_TIP = "tool_tip";
constexpr const char* POINT_FORCE_SENSOR = "force_sensor";

/// What was measured where (topic tool/frf).
struct MeasuredFrf {
  double stamp = 0.0;     ///< [s] of the last hit
  std::string tool;       ///< empty for a force sensor
  std::string point;      ///< POINT_TOOL_TIP or POINT_FORCE_SENSOR
  std::string direction;  ///< x, y or z
  FrequencyResponse frf;
};

/// Fitted modes of a measured FRF (topic tool/modes).
struct MeasuredModes {
  double stamp = 0.0;
  std::string tool, point, direction;
  std::string unit;  ///< m/N or 1
  ModalModel model;
  double relative_error = 0.0;  ///< [1]
};

}  // namespace smartmill
