#pragma once

#include <mutex>
#include <string>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <smartmill_msgs/PredictStability.h>
#include <smartmill_msgs/WhatIf.h>

#include "node/parameters.h"
#include "smartmill_ros/node_shell.h"
#include "smartmill_stability/chatter/chatter_advice.h"

namespace smartmill::stability {

/// Shell around ChartMaker and SortedDetection: FRFs and coefficients in, stability/chart and the service
/// stability/predict and stability/what_if out; compensated force (or vibration, sound) and controller state
/// in, chatter/state and chatter/advice out.
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
  bool whatIf(smartmill_msgs::WhatIf::Request& request, smartmill_msgs::WhatIf::Response& response);
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

  // What if is asked in a thread of its own: chatter must not wait for it.
  std::mutex maker_mutex_;
  ros::CallbackQueue what_if_queue_;
  ros::ServiceServer what_if_;
  ros::AsyncSpinner what_if_spinner_{1, &what_if_queue_};
};

}  // namespace smartmill::stability
