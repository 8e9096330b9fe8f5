#include <exception>

#include "node/monitor_node.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "monitor");
  // They outlive the node: the last line could not be logged after the last handle has shut ROS down.
  const ros::NodeHandle nh, private_nh("~");
  try {
    smartmill::discrepancy::MonitorNode node(nh, private_nh);
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL_STREAM(e.what());
    return 1;
  }
  return 0;
}
