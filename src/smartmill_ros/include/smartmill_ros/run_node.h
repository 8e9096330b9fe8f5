#pragma once

#include <cstring>
#include <exception>
#include <iostream>

#include <ros/ros.h>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill {

/// `NODE --parameters` prints the node's parameter file: keys, defaults, units, bounds, meaning.
/// @return whether that was asked for.
template <class Parameters>
bool printsParameters(int argc, char** argv) {
  if (argc != 2 || std::strcmp(argv[1], "--parameters") != 0) return false;
  Parameters parameters;
  std::cout << tableOf(parameters).yaml();
  return true;
}

/// main() of a node class that takes (nh, private_nh) and names its struct of parameters `Parameters`.
template <class Node>
int runNode(int argc, char** argv, const char* name) {
  if (printsParameters<typename Node::Parameters>(argc, argv)) return 0;
  ros::init(argc, argv, name);
  // They outlive the node: the last line could not be logged after the last handle has shut ROS down.
  const ros::NodeHandle nh, private_nh("~");
  try {
    Node node(nh, private_nh);
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("%s: %s", name, error.what());
    return 1;
  }
  return 0;
}

}  // namespace smartmill
