#include "session/machine_driver.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <smartmill_msgs/ArmMotion.h>
#include <boost/function.hpp>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::session {
namespace {

constexpr double HURRY = 0.4;          // [s] for each step when the program must end
constexpr double STOP_TIMEOUT = 10.0;  // [s] to stop the spindle after a failure

}  // namespace

MachineDriver::MachineDriver(ros::NodeHandle nh, std::function<bool()> stopped)
    : nh_(std::move(nh)), stopped_(std::move(stopped)), program_(nh_, names::RUN_PROGRAM, false) {
  subscriber_ = nh_.subscribe<smartmill_msgs::CncState>(
      names::CNC_STATE, 200,
      boost::function<void(const smartmill_msgs::CncState&)>([this](const smartmill_msgs::CncState& m) {
        const std::lock_guard<std::mutex> lock(mutex_);
        state_ = m;
      }));
}

smartmill_msgs::CncState MachineDriver::state() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return state_;
}

void MachineDriver::checkStop() const {
  if (stopped_() || !ros::ok()) throw Interrupted();
  for (const auto& [node, is_alive] : is_alive_) {
    if (!is_alive()) throw Error("node " + nh_.resolveName(node) + " has ended");
  }
}

bool MachineDriver::waitUntil(const std::function<bool()>& ready, double seconds) const {
  const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(seconds);
  while (!ready()) {
    checkStop();
    if (ros::SteadyTime::now() > end) return false;
    ros::WallDuration(POLL).sleep();
  }
  return true;
}

std::string MachineDriver::arm(bool on, double timeout) {
  smartmill_msgs::ArmMotion service;
  service.request.arm = on;
  if (!callService(names::ARM_MOTION, service, timeout))
    throw Error(std::string(names::ARM_MOTION) + ": no answer");
  if (service.response.code != smartmill_msgs::ArmMotion::Response::OK) throw Error(service.response.message);
  return service.response.message;
}

// Position after the last motion, from a controller state that is newer than the call.
std::array<double, 3> MachineDriver::restPosition() const {
  const ros::Time now = ros::Time::now();
  std::array<double, 3> position{};
  const auto at_rest = [&] {
    const smartmill_msgs::CncState current = state();
    if (current.header.stamp < now || !current.connected || current.motion) return false;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::optional<std::size_t> index = controllerAxis(current.axes, axis);
      if (!index || *index >= current.position.size()) return false;
      position[axis] = current.position[*index];
    }
    return true;
  };
  if (!waitUntil(at_rest, SERVICE_WAIT))
    throw Error(
        "cnc/state: expected a state with connected controller and X, Y and Z axes at rest, received none");
  return position;
}

std::string MachineDriver::run(const CutPlanner& planner, const PlannedCut& cut, double extra_time) {
  const std::array<double, 3> position = restPosition();
  smartmill_msgs::RunProgramGoal goal;
  goal.name = cut.condition.name;
  goal.program = planner.program(cut, position);
  goal.condition = toMsg(cut.condition);
  call(program_, names::RUN_PROGRAM, goal, cut.duration() + extra_time);
  std::string text = numberText(units::rpmFromRadPerSec(cut.condition.spindle_speed), 0) + " rpm";
  if (cut.feed > 0.0) {
    const Engagement& engagement = cut.condition.engagement;
    text += ", " + mm(engagement.axial_depth) + " deep, " +
            numberText(engagement.feed_per_tooth / units::MM, 3) + " mm per tooth, " +
            numberText(cut.feed / units::MM * 60.0, 0) + " mm/min";
  }
  return text;
}

std::string MachineDriver::makeSafe(bool hurry) {
  if (program_.isServerConnected()) {
    smartmill_msgs::RunProgramGoal goal;
    goal.header.stamp = ros::Time::now();
    goal.name = "stop the spindle";
    goal.program = "M5\n";
    program_.sendGoal(goal);
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(hurry ? HURRY : STOP_TIMEOUT);
    while (ros::ok() && !program_.getState().isDone() && ros::SteadyTime::now() < end)
      ros::WallDuration(POLL).sleep();
    if (!program_.getState().isDone()) program_.cancelGoal();
  }
  return arm(false, hurry ? HURRY : SERVICE_WAIT);
}

}  // namespace smartmill::session
