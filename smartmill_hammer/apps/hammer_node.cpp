#include <ros/ros.h>

#include "../src/node/hammer_server.h"
#include "smartmill_core/error.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "hammer");
  // They outlive the server: the last line could not be logged after the last handle has shut ROS down.
  const ros::NodeHandle nh, private_nh("~");
  try {
    smartmill::hammer::HammerServer server(nh, private_nh);
    ros::spin();
  } catch (const smartmill::Error& error) {
    ROS_FATAL("hammer: %s", error.what());
    return 1;
  }
  return 0;
}
