#pragma once

#include <array>
#include <deque>
#include <functional>
#include <string>
#include <utility>

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include "node/calibration_server.h"
#include "node/parameters.h"
#include "smartmill_ros/frf_server.h"
#include "smartmill_ros/node_shell.h"
#include "smartmill_ros/strike_client.h"

namespace smartmill::kalman {

/// Shell around CompensationPipeline: sensor blocks in, force/measured, force/compensated and force/wrench
/// out, in the machine's frame; taps in, tool/frf and tool/modes of the force sensor out.
class KalmanNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on a wrong parameter or model.
  KalmanNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void listen();
  void publish(const ForceBlock& measured, const ForceBlock& compensated);
  void publishWaiting();
  void publishWrench(const ForceBlock& block);
  bool findRotation();
  void watch();
  void watchMeasurement();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);
  std::pair<int, std::string> judge(const SpindleSensorHealth* spindle);

  NodeParameters parameters_;
  tf2_ros::Buffer transforms_;
  tf2_ros::TransformListener listener_;
  NodeShell shell_;
  std::string sensor_frame_;
  std::array<double, 9> rotation_{{1, 0, 0, 0, 1, 0, 0, 0, 1}};  // sensor to machine
  bool rotation_known_ = false;
  std::deque<std::pair<ForceBlock, ForceBlock>> waiting_;  // for the rotation
  std::size_t invalid_told_ = 0;
  double next_wrench_ = 0.0;  // [s]

  ros::Publisher measured_, compensated_, wrench_;
  StrikeClient strike_;
  CompensationPipeline sorted_;
  FrfServer measure_;
  CalibrationServer calibrate_;
};

}  // namespace smartmill::kalman
