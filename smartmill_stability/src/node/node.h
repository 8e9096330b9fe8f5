#pragma once

#include <string>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <smartmill_msgs/PredictStability.h>

#include "node/parameters_ros.h"
#include "smartmill_stability/chatter/chatter_advice.h"

namespace smartmill::stability {

/// Shell around ChartMaker and SortedDetection: FRFs and coefficients in, stability/chart and the service
/// stability/predict out; compensated force (or vibration, sound) and controller state in,
/// chatter/state and chatter/advice out.
class StabilityNode {
 public:
  /// @throws Error on a wrong parameter or model.
  StabilityNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  template <typename Message>
  void subscribe(ros::NodeHandle& nh, const char* topic, void (StabilityNode::*use)(const Message&));
  template <typename Message>
  void measured(const Message& message);
  template <typename Message>
  void stream(const Message& message);
  void publish(const ChatterState& state);
  void publish(const ChatterAdvice& advice);
  bool predict(smartmill_msgs::PredictStability::Request& request,
               smartmill_msgs::PredictStability::Response& response);
  void watch();
  void diagnoseChart(diagnostic_updater::DiagnosticStatusWrapper& status);
  void diagnoseChatter(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  ChartMaker maker_;
  SortedDetection detection_;
  ChatterAdvisor advisor_;
  std::string chart_problem_;  // why the last chart could not be made
  ChatterState last_state_;
  ros::WallTime last_input_;
  bool flushed_ = true;

  ros::Publisher chart_, chatter_, advice_;
  ros::ServiceServer predict_;
  std::vector<ros::Subscriber> subscribers_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer timer_;
};

}  // namespace smartmill::stability
