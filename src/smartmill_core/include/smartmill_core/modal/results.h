#pragma once

#include <cstdint>
#include <string>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {

/// Points at which FRFs are measured.
constexpr const char* POINT_TOOL_TIP = "tool_tip";
constexpr const char* POINT_FORCE_SENSOR = "force_sensor";

/// A measured FRF with its location (topic tool/frf).
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

/// Goal of the action MeasureFrf.
struct MeasureFrfGoal {
  double stamp = 0.0;  ///< [s] earlier sensor data are not used
  std::string tool, point, direction;
  int hits = 0;           ///< [1] to average
  int modes = 0;          ///< [1] 0: chosen by significance
  double stickout = 0.0;  ///< [m] 0: no offset correction
  int teeth = 0;          ///< [1] 0: from the model
};

/// Codes of the action MeasureFrf.
enum class FrfCode : std::uint8_t {
  ok = 0,
  cancelled = 1,
  no_flute = 2,
  no_hit = 3,
  motion_failed = 4,
  bad_goal = 5,
  bad_data = 6,
  fit_failed = 7
};

}  // namespace smartmill
