#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <ros/ros.h>
#include <smartmill_msgs/PanelKey.h>

#include "smartmill_sim/world/world.h"

namespace smartmill::sim {

/// The operator as services sim/panel/*: the keys of the controller's panel, and manual actions.
class OperatorPanel {
 public:
  explicit OperatorPanel(ros::NodeHandle nh) : nh_(std::move(nh)) {}

  void advertiseKeys(Controller& controller);
  /// Weights on the tool, change of the tool, another tap point.
  void advertiseManualActions(World& world, const WorldOptions& options);

 private:
  using Request = smartmill_msgs::PanelKey::Request;
  /// @return the reason of a refusal, empty: done
  using Press = std::function<std::string(const Request&)>;
  void advertise(const std::string& key, std::size_t values, Press press);

  ros::NodeHandle nh_;
  std::vector<ros::ServiceServer> keys_;
};

}  // namespace smartmill::sim
