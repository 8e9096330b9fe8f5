#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <ros/ros.h>
#include <smartmill_msgs/OperatorAction.h>
#include <smartmill_msgs/PanelKey.h>

#include "smartmill_sim/world/world.h"

namespace smartmill::sim {

/// The operator as services sim/panel/*: the keys of the controller's panel, and manual actions.
class OperatorPanel {
 public:
  explicit OperatorPanel(ros::NodeHandle nh) : nh_(std::move(nh)) {}

  void advertiseKeys(Controller& controller);
  /// Weights on the tool, change of the tool, another tap point; also the service operator/act of the
  /// machine.
  void advertiseManualActions(World& world, const WorldOptions& options);

 private:
  using Request = smartmill_msgs::PanelKey::Request;
  /// @return the reason of a refusal, empty: done
  using Press = std::function<std::string(const Request&)>;
  void advertise(const std::string& key, std::size_t values, Press press);

  bool act(const smartmill_msgs::OperatorAction::Request& request,
           smartmill_msgs::OperatorAction::Response& response);

  ros::NodeHandle nh_;
  std::map<std::uint8_t, std::function<void(const smartmill_msgs::OperatorAction::Request&)>> actions_;
  std::vector<ros::ServiceServer> keys_;
};

}  // namespace smartmill::sim
