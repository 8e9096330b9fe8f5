#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "node/tachometer_parameters.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::cnc {

/// PulseTachometer in ROS: sample blocks and the controller's state in, spindle/angle out.
class TachometerNode {
 public:
  using Parameters = TachometerNodeParameters;
  /// @throws Error on an invalid parameter.
  TachometerNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void handle(const SampleBlock& block);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  TachometerNodeParameters parameters_;
  PulseTachometer tachometer_;
  PulseReading last_{{0.0, NOT_A_NUMBER, 0.0}, NOT_A_NUMBER, NOT_A_NUMBER};
  NodeShell shell_;
  ros::Publisher angle_;
  std::string fault_;  // since the last publication of the diagnostics
};

}  // namespace smartmill::cnc
