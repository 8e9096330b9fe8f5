#pragma once

#include <array>
#include <string>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include "parameters_ros.h"
#include "smartmill_kalman/force_compensation.h"

namespace smartmill::kalman {

/// Shell around SortedCompensation: sensor blocks in, force/measured, force/compensated and force/wrench out,
/// in the machine's frame.
class KalmanNode {
 public:
  /// @throws Error on a wrong parameter or model.
  KalmanNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void block(const smartmill_msgs::SampleBlock& message);
  void publish(ForceBlock measured, ForceBlock compensated);
  void publishWrench(const ForceBlock& block);
  bool findRotation(const std::string& frame);
  void watch();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);
  template <typename Message>
  void input(const Message& message);

  NodeParameters parameters_;
  SortedCompensation sorted_;
  tf2_ros::Buffer transforms_;
  tf2_ros::TransformListener listener_;
  std::string sensor_frame_;
  std::array<double, 9> rotation_{{1, 0, 0, 0, 1, 0, 0, 0, 1}};  // sensor to machine
  bool rotation_known_ = false;
  double next_wrench_ = 0.0;  // [s]
  ros::WallTime last_block_;
  bool flushed_ = true;

  ros::Publisher measured_, compensated_, wrench_;
  std::vector<ros::Subscriber> subscribers_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer timer_;
};

}  // namespace smartmill::kalman
