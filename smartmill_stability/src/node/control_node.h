#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "smartmill_ros/node_shell.h"
#include "smartmill_stability/control/control_stream.h"

namespace smartmill::stability {

/// Shell around ControlStream: daq/displacement and spindle/angle in, control/command and control/machine
/// out.
class ControlNode {
 public:
  using Parameters = ControlStreamParameters;
  /// @throws Error on a wrong parameter.
  ControlNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void publish(const LearntMachine& learnt);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeShell shell_;
  ControlStream stream_;
  LearntMachine last_;
  ros::Publisher command_, machine_;
};

}  // namespace smartmill::stability
