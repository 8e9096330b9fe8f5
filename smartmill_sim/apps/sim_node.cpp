#include <ros/ros.h>

#include "../src/node/node.h"
#include "smartmill_core/error.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "sim");
  // They outlive the node: the last line could not be logged after the last handle has shut ROS down.
  const ros::NodeHandle nh, private_nh("~");
  try {
    smartmill::sim::Node node(nh, private_nh);
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("sim: %s", error.what());
    return 1;
  }
  return 0;
}
