#pragma once

#include <ros/ros.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "smartmill_cnc/linuxcnc/servo_stream.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::cnc {

/// Publishes every servo cycle of a LinuxCNC (cnc/servo in blocks, spindle/angle one by one) and forwards the
/// load of an external load meter to it. The diagnostics contain lost samples and delays.
class ServoPublisher {
 public:
  /// @param load_input topic of the load meter; empty: none
  ServoPublisher(ros::NodeHandle nh, NodeShell& shell, std::shared_ptr<linuxcnc::ServoStream> stream,
                 const std::string& load_input);
  ~ServoPublisher();
  ServoPublisher(const ServoPublisher&) = delete;
  ServoPublisher& operator=(const ServoPublisher&) = delete;

 private:
  void run();
  void publish(const linuxcnc::ServoSegment& segment);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  std::shared_ptr<linuxcnc::ServoStream> stream_;
  ros::Publisher servo_, angle_;
  std::uint64_t reported_samples_ = 0, reported_without_load_ = 0;  // at the last diagnostics
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

/// @return [s] ROS time
double rosSeconds();

}  // namespace smartmill::cnc
