#pragma once

#include <future>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_client.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <smartmill_msgs/ChooseProbingCut.h>
#include <smartmill_msgs/PredictStability.h>
#include <smartmill_msgs/SetOverrides.h>
#include <smartmill_msgs/WhatIf.h>

#include "node/parameters.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_ros/node_shell.h"
#include "smartmill_stability/chart/bistable_chart.h"
#include "smartmill_stability/chatter/chatter_advice.h"
#include "smartmill_stability/control/milling_control.h"

namespace smartmill::stability {

/// ROS node of ChartMaker, DetectionPipeline and MillingControl. From FRFs, modes and coefficients: topic
/// stability/chart, services stability/predict and stability/what_if; without FRFs, from verdicts on cuts:
/// service stability/choose_probing_cut. From compensated force (or vibration,
/// sound) and controller state: topics chatter/state and chatter/advice. With adaptive: true, the requests of
/// MillingControl are sent to the service cnc/set_overrides.
class StabilityNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on an invalid parameter or model.
  StabilityNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  /// Passes the streams to the detection, and the controller state also to advisor and control.
  struct Streams {
    StabilityNode& node;
    template <class Data>
    void push(const Data& data) {
      if constexpr (std::is_same_v<Data, CncState>) {
        node.advisor_.handle(data);
        node.control_.handle(data);
      }
      node.detection_.push(data);
    }
  };
  void listen();
  template <typename Measured>
  void handleMeasured(const Measured& measured);
  void handle(const ChatterState& state);
  /// Sends a request of the control to the controller, and returns the answer to the control.
  void override();
  void publish(const ChatterState& state);
  void publish(const ChatterAdvice& advice);
  bool predict(smartmill_msgs::PredictStability::Request& request,
               smartmill_msgs::PredictStability::Response& response);
  bool whatIf(smartmill_msgs::WhatIf::Request& request, smartmill_msgs::WhatIf::Response& response);
  bool chooseProbingCut(smartmill_msgs::ChooseProbingCut::Request& request,
                        smartmill_msgs::ChooseProbingCut::Response& response);
  /// Starts the chart of small and large vibrations in a thread, when its inputs are complete.
  void startBistable();
  void publishBistable();
  void watch();
  void diagnoseChart(diagnostic_updater::DiagnosticStatusWrapper& status);
  void diagnoseChatter(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  NodeShell shell_;
  ChartMaker maker_;
  DetectionPipeline detection_;
  ChatterAdvisor advisor_;
  MillingControl control_;
  Streams streams_{*this};
  std::string chart_problem_;  // error of the last chart
  ChatterState last_state_;
  std::string other_tool_;  // in use; empty: that of the model

  ros::Publisher chart_, chatter_, advice_, bistable_;
  ros::ServiceServer predict_;
  ros::ServiceClient overrides_;
  std::future<smartmill_msgs::SetOverrides::Response> answer_;  // to the pending request

  std::optional<IdentifiedForceCurves> curves_;
  bool bistable_outdated_ = false;
  std::future<std::optional<BistableChart>> bistable_chart_;  // in progress
  std::string bistable_problem_;

  // The services what_if and choose_probing_cut have their own threads, so that they do not delay the
  // detection.
  std::mutex maker_mutex_;
  ros::CallbackQueue what_if_queue_;
  ros::ServiceServer what_if_;
  ros::AsyncSpinner what_if_spinner_{1, &what_if_queue_};
  ros::CallbackQueue probing_queue_;
  ros::ServiceServer probing_;
  ros::AsyncSpinner probing_spinner_{1, &probing_queue_};
};

}  // namespace smartmill::stability
