#pragma once

#include <ros/node_handle.h>

#include "node/alignment_parameters.h"
#include "smartmill_daq/alignment/stream_alignment.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::daq {

/// StreamAlignment in ROS: the shift between two streams and its standard deviation as diagnostics.
class AlignmentNode {
 public:
  using Parameters = AlignmentNodeParameters;
  /// @throws Error on an invalid parameter.
  AlignmentNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);

 private:
  void listen(const SignalName& signal);
  void announceChange();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  AlignmentNodeParameters parameters_;
  StreamAlignment alignment_;
  NodeShell shell_;
  std::string change_;  // since the last publication of the diagnostics
};

}  // namespace smartmill::daq
