#pragma once

#include <string>

#include "smartmill_ros/parameter_reader.h"
#include "smartmill_stability/chart/chart.h"
#include "smartmill_stability/chatter/chatter_detector.h"

namespace smartmill::stability {

struct NodeParameters {
  std::string model;  ///< path of a smartmill-model/1 file: tool and spindle limits
  ChartParameters chart;
  ChatterParameters chatter;
  std::string chatter_signal = "force";  ///< force (compensated), vibration or sound (daq/...)
  double hold_back = 0.05;               ///< [s] >= 0
  double input_timeout = 1.0;            ///< [s] > 0, of wall time
};

/// @param model path that goes before the key `model`, which then may be absent.
/// @throws Error on a wrong type, an unknown key or a value out of its range.
NodeParameters readParameters(ParameterReader& reader, const std::string& model = "");

}  // namespace smartmill::stability
