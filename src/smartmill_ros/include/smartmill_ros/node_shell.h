#pragma once

#include <functional>
#include <string>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <ros/wall_timer.h>

#include "smartmill_ros/inputs.h"

namespace smartmill {

/// Whether other nodes reach a node under this name through the loopback interface only (roscpp then listens
/// on it alone): "localhost" or an address 127.x.x.x or ::1. @param host ROS_HOSTNAME or ROS_IP
bool isLoopback(const std::string& host);

/// Common parts of a node: inputs that catch exceptions, tasks on wall timers, diagnostics and the account of
/// its inputs (topic `health`) once a second, the count of its restarts and the service `follow` for a player
/// of recorded data.
class NodeShell {
 public:
  /// @param hardware id in the diagnostics @param input_timeout [s] see Inputs
  NodeShell(ros::NodeHandle nh, ros::NodeHandle private_nh, const std::string& hardware,
            double input_timeout);
  NodeShell(const NodeShell&) = delete;
  NodeShell& operator=(const NodeShell&) = delete;

  Inputs& inputs() { return inputs_; }

  /// Called for each publication of the diagnostics.
  void diagnose(const std::string& name,
                std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)> task);
  /// Publishes the diagnostics at once.
  void tell() { diagnostics_.force_update(); }

  /// Calls a task periodically and logs its exceptions. Received messages are processed first.
  /// @param period [s] of wall time, so that a paused replay does not stop it
  void every(double period, std::function<void()> task);

 private:
  void countStart();
  void diagnoseRestarts(diagnostic_updater::DiagnosticStatusWrapper& status);
  void publishHealth();
  bool follow(smartmill_msgs::Follow::Request& request, smartmill_msgs::Follow::Response& response);

  ros::NodeHandle nh_;
  Inputs inputs_;
  diagnostic_updater::Updater diagnostics_;
  std::vector<std::function<void()>> tasks_;
  double clock_offset_ = 0.0;  // [s] of the wall clock from steadyTime()
  std::vector<ros::SteadyTimer> timers_;
  ros::ServiceServer follow_;
  ros::Publisher health_;
  int starts_ = 1;                                         // in this launch
  double started_ = 0.0, counted_ = 0.0, cpu_time_ = 0.0;  // [s] wall time, that of cpu_time_, processor time
};

}  // namespace smartmill
