#pragma once

#include "smartmill_cnc/bridge.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill::cnc {

struct NodeParameters {
  FocasParameters controller;
  double reconnect_period = 1.0;  ///< [s] between two attempts to connect
  MotionParameters motion;
  double rate = 50.0;  ///< [Hz] of cnc/state and cnc/load
};

/// Reads and checks every key of cnc.yaml; what the file leaves to the machine model comes from there.
/// @throws Error naming key and value.
NodeParameters readParameters(ParameterReader& reader);

}  // namespace smartmill::cnc
