#pragma once

#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <smartmill_msgs/PredictStability.h>

#include "node/parameters.h"
#include "smartmill_ros/node_shell.h"
#include "smartmill_stability/chatter/chatter_advice.h"

namespace smartmill::stability {

/// Shell around ChartMaker and SortedDetection: FRFs and coefficients in, stability/chart and the service
/// stability/predict out; compensated force (or vibration, sound) and controller state in,
/// chatter/state and chatter/advice out.
class StabilityNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on a wrong parameter or model.
  StabilityNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void listen();
  template <typename Measured>
  void measured(const Measured& measured);
  void publish(const ChatterState& state);
  void publish(const ChatterAdvice& advice);
  bool predict(smartmill_msgs::PredictStability::Request& request,
               smartmill_msgs::PredictStability::Response& response);
  void watch();
  void diagnoseChart(diagnostic_updater::DiagnosticStatusWrapper& status);
  void diagnoseChatter(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  NodeShell shell_;
  ChartMaker maker_;
  SortedDetection detection_;
  ChatterAdvisor advisor_;
  std::string chart_problem_;  // why the last chart could not be made
  ChatterState last_state_;

  ros::Publisher chart_, chatter_, advice_;
  ros::ServiceServer predict_;
};

}  // namespace smartmill::stability
