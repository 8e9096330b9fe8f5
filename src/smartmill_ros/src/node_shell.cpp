#include "smartmill_ros/node_shell.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <map>
#include <string>
#include <utility>

#include <ros/console.h>
#include <ros/network.h>
#include <smartmill_msgs/NodeHealth.h>

#include "smartmill_core/io/process_usage.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/follower.h"
#include "smartmill_ros/kept_messages.h"
#include "smartmill_ros/steady_time.h"

namespace smartmill {
namespace {

constexpr double TICK = 0.05;          // [s]
constexpr double HEALTH_PERIOD = 1.0;  // [s]
constexpr double CLOCK_STEP = 0.2;     // [s] beyond corrections that a time server makes gradually

// ROS 1 has no authentication: every program that reaches a node can publish and call its services.
void diagnoseNetwork(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const std::string& host = ros::network::getHost();
  status.add("host", host);
  if (isLoopback(host)) {
    status.summary(Level::OK, "reachable from this computer only");
  } else {
    status.summary(Level::WARN,
                   "reachable from other computers as " + host +
                       ", without authentication; ROS_HOSTNAME=localhost closes it (docs/security.md)");
  }
}

}  // namespace

bool isLoopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host.rfind("127.", 0) == 0;
}

NodeShell::NodeShell(ros::NodeHandle nh, ros::NodeHandle private_nh, const std::string& hardware,
                     double input_timeout)
    : nh_(nh),
      inputs_(nh, input_timeout),
      diagnostics_(nh, private_nh),
      follow_(private_nh.advertiseService(FOLLOW, &NodeShell::follow, this)) {
  diagnostics_.setHardwareID(hardware);
  diagnostics_.add("inputs", &inputs_, &Inputs::diagnose);
  diagnostics_.add("network", diagnoseNetwork);
  countStart();
  diagnostics_.add("restarts", this, &NodeShell::diagnoseRestarts);
  health_ = nh.advertise<smartmill_msgs::NodeHealth>(names::NODE_HEALTH, 10);
  started_ = ros::WallTime::now().toSec();
  counted_ = steadyTime();
  cpu_time_ = processUsage().cpu_time;
  every(HEALTH_PERIOD, [this] { publishHealth(); });
  every(TICK, [this] {
    inputs_.tick(TICK);
    diagnostics_.update();  // publishes once a second
  });
}

void NodeShell::countStart() {
  constexpr const char* KEY = "count";
  KeptTexts starts(nh_, "starts");
  const std::map<std::string, std::string> kept = starts.all();
  if (const auto before = kept.find(KEY); before != kept.end())
    starts_ = std::atoi(before->second.c_str()) + 1;
  starts.keep(KEY, std::to_string(starts_));
  if (starts_ > 1) ROS_WARN("%s: start %d in this launch", ros::this_node::getName().c_str(), starts_);
}

void NodeShell::diagnoseRestarts(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  if (starts_ == 1) {
    status.summary(Level::OK, "not restarted");
  } else {
    status.summaryf(Level::WARN, "restarted %d times in this launch", starts_ - 1);
  }
  status.add("starts", starts_);
}

void NodeShell::publishHealth() {
  const ProcessUsage usage = processUsage();
  const double now = steadyTime(), wall = ros::WallTime::now().toSec();
  if (const double step = wall - now - clock_offset_; std::abs(step) > CLOCK_STEP) {
    ROS_WARN("the clock of this computer was set by %+.1f s", step);
    clock_offset_ += step;
  }
  smartmill_msgs::NodeHealth health;
  health.header.stamp = ros::Time::now();
  health.node = ros::this_node::getName();
  health.started = started_;
  health.starts = static_cast<std::uint32_t>(starts_);
  health.cpu = (usage.cpu_time - cpu_time_) / std::max(now - counted_, TICK);
  health.memory = usage.memory;
  health.descriptors = usage.descriptors;
  health.threads = usage.threads;
  health.inputs = inputs_.accounts();
  health_.publish(health);
  cpu_time_ = usage.cpu_time;
  counted_ = now;
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
  timers_.push_back(nh_.createSteadyTimer(ros::WallDuration(period),
                                          [task = tasks_.back()](const ros::SteadyTimerEvent&) { task(); }));
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
