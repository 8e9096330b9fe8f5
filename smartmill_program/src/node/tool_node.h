#pragma once

#include <future>
#include <map>
#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_client.h>
#include <ros/service_server.h>
#include <smartmill_msgs/FeedHold.h>
#include <smartmill_msgs/NewTool.h>

#include "node/tool_parameters.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::program {

/// ToolMonitor in ROS: force, spindle/angle, cnc/state, cut/condition and material/coefficients in,
/// tool/condition out; service tool/new_tool. With hold_on_breakage a lost tooth requests a feed hold.
class ToolNode {
 public:
  using Parameters = ToolNodeParameters;
  /// @throws Error on an invalid parameter or model.
  ToolNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);

 private:
  void listen();
  bool newTool(smartmill_msgs::NewTool::Request& request, smartmill_msgs::NewTool::Response& response);
  void publish(const ToolReport& report);
  void requestHold();
  void readAnswer();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  ToolNodeParameters parameters_;
  NodeShell shell_;
  ToolMonitor monitor_;
  ros::Publisher publisher_;
  ros::ServiceServer new_tool_;
  ros::ServiceClient hold_;
  std::future<smartmill_msgs::FeedHold::Response> answer_;
  std::string answered_;
  ToolReport last_;
};

}  // namespace smartmill::program
