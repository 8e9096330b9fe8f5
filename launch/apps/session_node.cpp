#include <atomic>
#include <csignal>
#include <cstdlib>
#include <exception>

#include "session/session.h"
#include "smartmill_ros/run_node.h"

namespace {
std::atomic<bool> stop{false};
void onSignal(int) {
  stop = true;
}
}  // namespace

int main(int argc, char** argv) {
  if (smartmill::printsParameters<smartmill::session::SessionParameters>(argc, argv)) return 0;
  // Goals must be cancelled before ROS goes: the session handles Ctrl-C itself.
  ros::init(argc, argv, "session", ros::init_options::NoSigintHandler);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const ros::NodeHandle nh, private_nh("~");
  try {
    return smartmill::session::Session(nh, private_nh, stop).run();
  } catch (const std::exception& e) {
    ROS_FATAL_STREAM(e.what());
    return 1;
  }
}
