#include <exception>

#include "session/session.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_ros/run_node.h"

int main(int argc, char** argv) {
  using namespace smartmill::session;
  if (smartmill::printsParameters<SessionParameters>(argc, argv)) return 0;
  ros::init(argc, argv, "session", ros::init_options::NoSigintHandler);
  smartmill::catchStopSignals();
  const ros::NodeHandle nh, private_nh("~");
  try {
    const smartmill::MasterWatch master(nh);
    return Session(nh, private_nh, smartmill::stopRequested).run();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(error.what());
    return 1;
  }
}
