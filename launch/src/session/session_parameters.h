#pragma once

#include <string>

#include "smartmill_launch/session/session_plan.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill::session {

/// Everything that session_node is told; see config/session.yaml.
struct SessionParameters {
  PlanParameters plan;
  std::string model;                      ///< smartmill-model/1 file of the believed machine
  std::string summary;                    ///< JSON file to write; empty: none
  std::string tool_directions = "xy";     ///< of the tool's FRF, letters of xy
  std::string sensor_directions = "xyz";  ///< of the force sensor's taps, letters of xyz
  int hits = 10;                          ///< [1] 1..1000, on the tool, a direction
  int modes = 0;                          ///< [1] 0..20 of the tool; 0: chosen by evidence
  int sensor_hits = 10;                   ///< [1] 1..1000
  int sensor_modes = 0;                   ///< [1] 0..20
  bool verify = true;                     ///< wait for the chart and check it with two cuts
  double start_delay = 2.0;               ///< [s] >= 0 before the first goal: a recorder finds the topics
  double ready_timeout = 30.0;            ///< [s] > 0 for nodes and sensors to be there
  double frf_timeout = 300.0;             ///< [s] > 0 of one direction
  double program_timeout = 60.0;          ///< [s] > 0 beyond a program's own time
  double identify_timeout = 20.0;         ///< [s] > 0
  double chart_timeout = 60.0;            ///< [s] > 0

  /// @throws Error naming key and value.
  void validate() const;
};

/// @throws Error on a wrong type, an unknown key or a value out of range.
SessionParameters readParameters(ParameterReader& reader);

}  // namespace smartmill::session
