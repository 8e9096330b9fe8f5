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

/// Shell around ChartMaker and DetectionPipeline: FRFs and coefficients in, stability/chart and the service
/// stability/predict and stability/what_if out; compensated force (or vibration, sound) and controller state
/// in, chatter/state and chatter/advice out. With adaptive: true MillingControl's wishes go to
/// cnc/set_overrides.
class StabilityNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on a wrong parameter or model.
  StabilityNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  /// What comes in on its way to the detection: advice and control need to know the controller's state too.
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
  void measured(const Measured& measured);
  void judged(const ChatterState& state);
  /// Hands a wish of the control to the controller, or its answer back.
  void override();
  void publish(const ChatterState& state);
  void publish(const ChatterAdvice& advice);
  bool predict(smartmill_msgs::PredictStability::Request& request,
               smartmill_msgs::PredictStability::Response& response);
  bool whatIf(smartmill_msgs::WhatIf::Request& request, smartmill_msgs::WhatIf::Response& response);
  /// Makes the chart of small and large vibrations aside, where what it needs is there.
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
  std::string chart_problem_;  // why the last chart could not be made
  ChatterState last_state_;

  ros::Publisher chart_, chatter_, advice_, bistable_;
  ros::ServiceServer predict_;
  ros::ServiceClient overrides_;
  std::future<smartmill_msgs::SetOverrides::Response> answer_;  // of the wish that is on its way

  std::optional<IdentifiedForceCurves> curves_;
  bool bistable_due_ = false;
  std::future<std::optional<BistableChart>> bistable_chart_;  // that is being made
  std::string bistable_problem_;

  // What if is asked in a thread of its own: chatter must not wait for it.
  std::mutex maker_mutex_;
  ros::CallbackQueue what_if_queue_;
  ros::ServiceServer what_if_;
  ros::AsyncSpinner what_if_spinner_{1, &what_if_queue_};
};

}  // namespace smartmill::stability
