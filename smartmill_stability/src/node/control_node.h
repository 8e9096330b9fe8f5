#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include "smartmill_ros/conversions.h"
#include "smartmill_stability/control/control_stream.h"

namespace smartmill::stability {

/// Shell around ControlStream: daq/displacement and spindle/angle in, control/command and control/machine
/// out.
class ControlNode {
 public:
  /// @throws Error on a wrong parameter.
  ControlNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void publish(const LearntMachine& learnt);

  ControlStream stream_;
  LearntMachine last_;
  std::string problem_;
  ros::Publisher command_, machine_;
  ros::Subscriber displacement_, angle_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer timer_;
};

}  // namespace smartmill::stability
