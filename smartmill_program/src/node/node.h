#pragma once

#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/CuttingCondition.h>

#include "node/parameters.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_program/live/part_monitor.h"
#include "smartmill_program/live/path_follower.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::program {

/// PathFollower and PartMonitor in ROS: the controller's states, force/compensated, chatter/state and
/// material/coefficients in; cut/condition, program/path and program/progress out.
class ProgramNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on an invalid parameter, program or model.
  ProgramNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);

 private:
  using ConditionEvent = ros::MessageEvent<const smartmill_msgs::CuttingCondition>;
  struct Prepared {
    std::shared_ptr<const LiveProgram> program;
    ToolModels models;
    ConditionNames names;
  };
  static Prepared prepare(const NodeParameters& parameters);
  void listen();
  void handle(const CncState& state);
  void handle(const CoefficientSet& coefficients);
  void predict(const std::optional<CuttingCoefficients>& coefficients);
  void readPredictions();
  void publish(const PartProgress& progress);
  void handle(const ConditionEvent& event);
  void endPredecessor(double stamp);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  Prepared prepared_;
  PathFollower follower_;
  NodeShell shell_;
  PartMonitor monitor_;
  ros::Publisher publisher_, path_, progress_;
  ros::Subscriber conditions_;
  std::map<std::string, std::string> others_;  // names of valid conditions by their node
  std::string condition_;                      // name of the present one; empty: none
  std::size_t losses_ = 0;                     // logged
  std::optional<double> first_state_;          // [s]
  bool ended_predecessor_ = false;
  std::string predicted_for_;  // coefficients of the predictions; empty: none
  std::future<std::vector<PiecePrediction>> predictions_;
  std::optional<CoefficientSet> early_;  // arrived during the prediction by the models
};

}  // namespace smartmill::program
