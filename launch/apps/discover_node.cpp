#include <atomic>
#include <csignal>
#include <exception>

#include "session/discovery.h"
#include "smartmill_ros/run_node.h"

namespace {
std::atomic<bool> stop{false};
void onSignal(int) {
  stop = true;
}
}  // namespace

int main(int argc, char** argv) {
  using smartmill::session::Discovery;
  if (smartmill::printsParameters<Discovery::Parameters>(argc, argv)) return 0;
  // The spindle must be stopped before ROS goes: the node handles Ctrl-C itself.
  ros::init(argc, argv, "discover", ros::init_options::NoSigintHandler);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const ros::NodeHandle nh, private_nh("~");
  try {
    Discovery discovery(nh, private_nh);
    ros::AsyncSpinner spinner(1);
    spinner.start();
    while (!stop && ros::ok()) ros::WallDuration(0.05).sleep();
    discovery.stop();
    spinner.stop();
  } catch (const std::exception& error) {
    ROS_FATAL("discover: %s", error.what());
    return 1;
  }
  return 0;
}
