#include <ros/ros.h>

#include "hammer_server.h"
#include "smartmill_core/error.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "hammer");
  try {
    smartmill::hammer::HammerServer server(ros::NodeHandle(), ros::NodeHandle("~"));
    ros::spin();
  } catch (const smartmill::Error& error) {
    ROS_FATAL("hammer: %s", error.what());
    return 1;
  }
  return 0;
}
