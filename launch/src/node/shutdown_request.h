#pragma once

#include <atomic>
#include <csignal>
#include <initializer_list>

namespace smartmill::session {

/// Handles SIGINT and SIGTERM in place of ROS (ros::init with NoSigintHandler), so that the program can end
/// its goals, the spindle or a file while ROS is still running.
/// @return true once a shutdown is requested
inline const std::atomic<bool>& catchShutdownRequest() {
  static std::atomic<bool> requested{false};
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { requested = true; });
  return requested;
}

}  // namespace smartmill::session
