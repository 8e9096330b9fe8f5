#pragma once

#include <string>

#include "smartmill_kalman/compensation/sorted_compensation.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill::kalman {

/// Parameters of kalman_node, see launch/config/kalman.yaml.
struct NodeParameters {
  CompensationParameters compensation;
  TapParameters taps;
  std::string model;           ///< machine model file whose force_sensor section gives the sensor
  std::string sensor_matrix;   ///< smartmill-sensor-matrix/1 file with the cross-talk; empty: none
  std::string spindle_sensor;  ///< smartmill-spindle-sensor/1 file for blocks of six channels; empty: none
  double spindle_sensor_length = 0.139;  ///< [m] > 0 of tool and holder
  bool command_machine = true;           ///< false: replay; no blow is asked for, the recorded ones answer
  double hold_back = 0.05;               ///< [s] >= 0
  double wrench_rate = 100.0;            ///< [Hz] > 0
  double drift_limit = 0.0;    ///< [N] >= 0 zero of the sensor that raises a diagnostic; 0: not watched
  double model_max_age = 0.0;  ///< [s] >= 0 age of the taps that raises a diagnostic; 0: not watched
  double input_timeout = 1.0;  ///< [s] > 0 silence of the sensor that raises a diagnostic
};

/// Reads and checks all parameters; model may stay empty. @throws Error.
NodeParameters readParameters(ParameterReader& reader);

}  // namespace smartmill::kalman
