#include <exception>

#include "node/shutdown_request.h"
#include "session/session.h"
#include "smartmill_ros/run_node.h"

int main(int argc, char** argv) {
  using namespace smartmill::session;
  if (smartmill::printsParameters<SessionParameters>(argc, argv)) return 0;
  ros::init(argc, argv, "session", ros::init_options::NoSigintHandler);
  const std::atomic<bool>& stop = catchShutdownRequest();
  const ros::NodeHandle nh, private_nh("~");
  try {
    const smartmill::MasterWatch master(nh);
    return Session(nh, private_nh, stop).run();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(error.what());
    return 1;
  }
}
