#include <exception>

#include "node/control_node.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "chatter_control");
  // They outlive the node: the last line could not be logged after the last handle has shut ROS down.
  const ros::NodeHandle nh, private_nh("~");
  try {
    smartmill::stability::ControlNode node(nh, private_nh);
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL_STREAM(e.what());
    return 1;
  }
  return 0;
}
