#pragma once

#include <array>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include "node/measure_server.h"
#include "node/parameters_ros.h"

namespace smartmill::kalman {

/// Shell around SortedCompensation: sensor blocks in, force/measured, force/compensated and force/wrench out,
/// in the machine's frame; taps in, tool/frf and tool/modes of the force sensor out.
class KalmanNode {
 public:
  /// @throws Error on a wrong parameter or model.
  KalmanNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  template <typename Message, typename Handle>
  void subscribe(ros::NodeHandle& nh, const char* topic, Handle handle);
  void publish(const ForceBlock& measured, const ForceBlock& compensated);
  void publishWaiting();
  void publishWrench(const ForceBlock& block);
  bool findRotation();
  void watch();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  tf2_ros::Buffer transforms_;
  tf2_ros::TransformListener listener_;
  std::string sensor_frame_;
  std::array<double, 9> rotation_{{1, 0, 0, 0, 1, 0, 0, 0, 1}};  // sensor to machine
  bool rotation_known_ = false;
  std::deque<std::pair<ForceBlock, ForceBlock>> waiting_;  // for the rotation
  std::size_t invalid_told_ = 0;
  double next_wrench_ = 0.0;  // [s]
  ros::WallTime last_block_, last_hammer_;
  bool flushed_ = true, hammer_seen_ = false;

  ros::Publisher measured_, compensated_, wrench_;
  SortedCompensation sorted_;
  MeasureServer measure_;
  std::vector<ros::Subscriber> subscribers_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer timer_, diagnostics_timer_;
};

}  // namespace smartmill::kalman
