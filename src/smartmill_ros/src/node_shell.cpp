#include "smartmill_ros/node_shell.h"

#include <exception>
#include <utility>

#include <ros/console.h>

#include "smartmill_ros/follower.h"

namespace smartmill {
namespace {

constexpr double TICK = 0.05;  // [s]

}  // namespace

NodeShell::NodeShell(ros::NodeHandle nh, ros::NodeHandle private_nh, const std::string& hardware,
                     double input_timeout)
    : nh_(nh),
      inputs_(nh, input_timeout),
      diagnostics_(nh, private_nh),
      follow_(private_nh.advertiseService(FOLLOW, &NodeShell::follow, this)) {
  diagnostics_.setHardwareID(hardware);
  diagnostics_.add("inputs", &inputs_, &Inputs::diagnose);
  every(TICK, [this] {
    inputs_.tick(TICK);
    diagnostics_.update();  // publishes once a second
  });
}

void NodeShell::diagnose(const std::string& name,
                         std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)> task) {
  diagnostics_.add(name, std::move(task));
}

void NodeShell::every(double period, std::function<void()> task) {
  tasks_.push_back([task = std::move(task)] {
    try {
      task();
    } catch (const std::exception& error) {
      ROS_ERROR_STREAM_THROTTLE(5.0, error.what());
    }
  });
  timers_.push_back(nh_.createWallTimer(ros::WallDuration(period),
                                        [task = tasks_.back()](const ros::WallTimerEvent&) { task(); }));
}

bool NodeShell::follow(smartmill_msgs::Follow::Request& request, smartmill_msgs::Follow::Response& response) {
  inputs_.follow(request, response);
  // The tasks detect the end of data and release delayed results.
  if (request.phase == smartmill_msgs::Follow::Request::END) {
    for (const auto& task : tasks_) task();
  }
  return true;
}

}  // namespace smartmill
