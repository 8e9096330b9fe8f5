#pragma once

#include <map>
#include <optional>
#include <string>

#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <smartmill_msgs/CuttingCondition.h>

#include "node/parameters.h"
#include "smartmill_program/live/path_follower.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::program {

/// PathFollower in ROS: the controller's states in, cut/condition out.
class ProgramNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on an invalid parameter, program or model.
  ProgramNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);

 private:
  using ConditionEvent = ros::MessageEvent<const smartmill_msgs::CuttingCondition>;
  void handle(const CncState& state);
  void handle(const ConditionEvent& event);
  void endPredecessor(double stamp);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  PathFollower follower_;
  NodeShell shell_;
  ros::Publisher publisher_;
  ros::Subscriber conditions_;
  std::map<std::string, std::string> others_;  // names of valid conditions by their node
  std::string condition_;                      // name of the present one; empty: none
  std::size_t losses_ = 0;                     // logged
  std::optional<double> first_state_;          // [s]
  bool ended_predecessor_ = false;
};

}  // namespace smartmill::program
