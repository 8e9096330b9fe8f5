#pragma once

#include <atomic>
#include <csignal>
#include <initializer_list>

namespace smartmill::session {

/// Takes Ctrl-C and kill from ROS (ros::init with NoSigintHandler): goals, spindle or file are brought to
/// their end by the program itself, while ROS is still there.
/// @return true once the end was asked for
inline const std::atomic<bool>& catchShutdownRequest() {
  static std::atomic<bool> asked{false};
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { asked = true; });
  return asked;
}

}  // namespace smartmill::session
