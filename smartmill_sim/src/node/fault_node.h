#pragma once

#include <functional>
#include <map>
#include <string>

#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <smartmill_msgs/SetFault.h>

#include "node/fault_parameters.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::sim {

/// Streams of sensors with faults on command: sim/healthy/TOPIC in, TOPIC out.
class FaultNode {
 public:
  using Parameters = FaultParameters;
  /// @throws Error on an invalid parameter, or without /use_sim_time: at a machine nothing may falsify its
  /// sensors.
  FaultNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  /// One topic, whatever its type.
  struct Stream {
    std::function<void(const StreamFault&)> add, begin;
    std::function<void()> clear, flush;
    std::string command = {};  // last one
  };
  template <class Data, class Publish>
  void pass(ros::NodeHandle& nh, const std::string& topic, Publish publish);
  void passBlocks(ros::NodeHandle& nh, const std::string& topic);
  void passAngles(ros::NodeHandle& nh, const std::string& topic);
  bool set(smartmill_msgs::SetFault::Request& request, smartmill_msgs::SetFault::Response& response);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  FaultParameters parameters_;
  NodeShell shell_;
  std::map<std::string, Stream> streams_;
  ros::ServiceServer service_;
};

}  // namespace smartmill::sim
