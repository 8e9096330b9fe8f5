#pragma once

#include <string>

#include "smartmill_ros/parameter_reader.h"
#include "smartmill_sim/world/world.h"

namespace smartmill::sim {

/// Parameters of sim_node.
struct NodeParameters {
  std::string model;               ///< smartmill-model/1 file
  std::string bind = "127.0.0.1";  ///< address of the controller
  int port = 8193;                 ///< 0: any free one
  double most_behind = 0.25;       ///< [s] of lag behind the clock before samples are lost
  WorldOptions world;
};

/// @throws Error naming key and value: unknown key, wrong type, out of range.
NodeParameters readParameters(ParameterReader& reader);

}  // namespace smartmill::sim
