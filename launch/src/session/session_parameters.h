#pragma once

#include <string>

#include "smartmill_launch/session/calibration_plan.h"
#include "smartmill_launch/session/session_plan.h"

namespace smartmill::session {

/// Parameters of session_node.
struct SessionParameters {
  std::string model;
  std::string summary;
  std::string tool_directions = "xy";
  std::string sensor_directions = "xyz";
  int hits = 20, modes = 0;
  int sensor_hits = 10, sensor_modes = 0;
  bool verify = true;
  bool use_stored = true;
  std::string recorder;
  bool resume = false;
  double start_delay = 2.0;
  double ready_timeout = 30.0;
  double frf_timeout = 300.0;
  double program_timeout = 60.0;
  double identify_timeout = 20.0;
  double chart_timeout = 60.0;
  PlanParameters plan;
  CalibrationParameters calibration;

  /// Parameters of the plan with the cuts that the force sensor requires.
  PlanParameters cuts() const;

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;
};

}  // namespace smartmill::session
