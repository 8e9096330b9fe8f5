#pragma once

#include <functional>
#include <string>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/wall_timer.h>

#include "smartmill_ros/inputs.h"

namespace smartmill {

/// What every node has around its class: inputs that catch, work on a wall timer, diagnostics once a second,
/// the service `follow` for whoever plays data to it.
class NodeShell {
 public:
  /// @param hardware the id in the diagnostics @param input_timeout [s] see Inputs
  NodeShell(ros::NodeHandle nh, ros::NodeHandle private_nh, const std::string& hardware,
            double input_timeout);
  NodeShell(const NodeShell&) = delete;
  NodeShell& operator=(const NodeShell&) = delete;

  Inputs& inputs() { return inputs_; }

  /// Called for each publication of the diagnostics.
  void diagnose(const std::string& name,
                std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)> task);
  /// The diagnostics now, for news that should not wait.
  void tell() { diagnostics_.force_update(); }

  /// @param period [s] of wall time: it goes on when a recording's clock stands. What work throws is logged.
  /// Timers wait behind the messages that have come.
  void every(double period, std::function<void()> work);

 private:
  bool follow(smartmill_msgs::Follow::Request& request, smartmill_msgs::Follow::Response& response);

  ros::NodeHandle nh_;
  Inputs inputs_;
  diagnostic_updater::Updater diagnostics_;
  std::vector<std::function<void()>> works_;
  std::vector<ros::WallTimer> timers_;
  ros::ServiceServer follow_;
};

}  // namespace smartmill
