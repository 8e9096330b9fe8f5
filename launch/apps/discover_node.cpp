#include <exception>

#include "session/discovery.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_ros/run_node.h"

int main(int argc, char** argv) {
  using namespace smartmill::session;
  if (smartmill::printsParameters<Discovery::Parameters>(argc, argv)) return 0;
  ros::init(argc, argv, "discover", ros::init_options::NoSigintHandler);
  smartmill::catchStopSignals();
  const ros::NodeHandle nh, private_nh("~");
  try {
    Discovery discovery(nh, private_nh);
    const smartmill::MasterWatch master(nh);
    ros::AsyncSpinner spinner(1);
    spinner.start();
    while (!smartmill::stopRequested() && ros::ok()) ros::WallDuration(0.05).sleep();
    discovery.stop();
    spinner.stop();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(error.what());
    return 1;
  }
  return 0;
}
