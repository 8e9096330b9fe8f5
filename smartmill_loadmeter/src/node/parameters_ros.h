#pragma once

#include <string>

#include "smartmill_loadmeter/identification/identification.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill::loadmeter {

struct NodeParameters {
  IdentificationParameters identification;
  std::string model;              ///< path of the model file
  std::string database;           ///< path of the database; empty: in memory
  std::string motor_calibration;  ///< path of what calibrate wrote; empty: no motor currents
  double hold_back = 0.05;        ///< [s]
  double input_timeout = 3.0;     ///< [s] wall clock
};

/// Reads launch/config/loadmeter.yaml from the server or the file. @throws Error naming key and value.
NodeParameters readParameters(ParameterReader& reader);

}  // namespace smartmill::loadmeter
