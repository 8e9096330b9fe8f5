#pragma once

#include <cstring>
#include <exception>
#include <iostream>

#include <ros/ros.h>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_ros/master_watch.h"

namespace smartmill {

/// `NODE --parameters` prints the node's parameter file: keys, defaults, units, bounds, meaning.
/// @return whether the command line requests it.
template <class Parameters>
bool printsParameters(int argc, char** argv) {
  if (argc != 2 || std::strcmp(argv[1], "--parameters") != 0) return false;
  Parameters parameters;
  std::cout << tableOf(parameters).yaml();
  return true;
}

/// main() of a node class with a constructor (nh, private_nh) and a type `Parameters`. Outlives the ROS
/// master.
template <class Node>
int runNode(int argc, char** argv, const char* name) {
  if (printsParameters<typename Node::Parameters>(argc, argv)) return 0;
  ros::init(argc, argv, name);
  // The handles outlive the node, since the last handle shuts ROS down and ends the log.
  const ros::NodeHandle nh, private_nh("~");
  try {
    Node node(nh, private_nh);
    const MasterWatch master(nh);
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("%s: %s", name, error.what());
    return 1;
  }
  return 0;
}

}  // namespace smartmill
