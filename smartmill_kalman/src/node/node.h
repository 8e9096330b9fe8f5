#pragma once

#include <array>
#include <cstddef>
#include <deque>
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

/// CompensationPipeline in ROS: sensor blocks in; force/measured, force/compensated and force/wrench out, in
/// the machine's frame; taps in, tool/frf and tool/modes of the force sensor out.
class KalmanNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on an invalid parameter or model.
  KalmanNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  CompensationPipeline::Outputs pipelineOutputs();
  FrfServer::Handlers measurementHandlers();
  void subscribe();
  void enqueue(ros::Publisher& publisher, const ForceBlock& block);
  void publishWaiting();
  void publishWrench(const ForceBlock& block);
  bool lookUpRotation();
  void publishSensor();
  void checkInputs();
  void checkAngles();
  void checkTorque();
  void checkMeasurement();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);
  std::pair<int, std::string> summary(const SpindleSensorHealth* spindle);

  NodeParameters parameters_;
  std::string force_input_ = parameters_.input();
  tf2_ros::Buffer transforms_;
  tf2_ros::TransformListener listener_;
  NodeShell shell_;
  std::string sensor_frame_;
  std::array<double, 9> rotation_{{1, 0, 0, 0, 1, 0, 0, 0, 1}};  // sensor to machine
  bool rotation_known_ = false;
  std::deque<std::pair<ros::Publisher*, ForceBlock>> waiting_;  // for the rotation
  std::size_t dropped_blocks_ = 0;                              // the rotation came too late
  std::size_t failed_blocks_ = 0;                               // could not be compensated
  std::string last_failure_;
  std::size_t reported_invalid_ = 0;  // samples
  std::size_t reported_failures_ = 0, reported_drops_ = 0;
  double next_wrench_ = 0.0;  // [s]
  double blocks_from_ = 0.0;  // [s] silence of spindle/angle when blocks began to come

  ros::Publisher measured_, compensated_, wrench_, sensor_state_;
  StrikeClient strike_;
  MachineModel model_;
  CompensationPipeline pipeline_;
  FrfServer measurement_server_;
  CalibrationServer calibration_server_;
};

}  // namespace smartmill::kalman
