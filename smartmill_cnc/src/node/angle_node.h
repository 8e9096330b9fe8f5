#pragma once

#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "node/angle_parameters.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::cnc {

/// AngleSources in ROS: spindle/angle of the best source that works, the sources as diagnostics.
class AngleNode {
 public:
  using Parameters = AngleNodeParameters;
  /// @throws Error on an invalid parameter.
  AngleNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);

 private:
  void listen(const std::string& topic, AngleSources::Angles (AngleSources::*push)(const SampleBlock&));
  void publish(const AngleSources::Angles& angles);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  AngleNodeParameters parameters_;
  AngleSources sources_;
  NodeShell shell_;
  ros::Publisher angle_;
  std::string news_;  // since the last publication of the diagnostics
};

}  // namespace smartmill::cnc
