#pragma once

#include <array>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include <actionlib/client/simple_action_client.h>
#include <ros/ros.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/RunProgramAction.h>

#include "session/number_text.h"
#include "smartmill_core/error.h"
#include "smartmill_launch/session/cut_planner.h"

namespace smartmill::session {

/// The caller cancels the work; not a failure of a step.
struct Interrupted {};

template <class Action>
using Client = actionlib::SimpleActionClient<Action>;

/// Client of the actions and services of the nodes for a sequence of steps. Every wait has a time limit,
/// reports its cause and can be interrupted. Runs cuts by cnc/run_program.
class MachineDriver {
 public:
  static constexpr double POLL = 0.01;         // [s]
  static constexpr double SERVICE_WAIT = 5.0;  // [s]

  /// @param nh its callback queue, served by another thread, receives the controller state
  /// @param stopped polled by the waiting thread; true interrupts it
  MachineDriver(ros::NodeHandle nh, std::function<bool()> stopped);

  /// From now on every wait ends with an error if a node has ended. @param is_alive of each, by name
  void require(std::map<std::string, std::function<bool()>> is_alive) { is_alive_ = std::move(is_alive); }

  /// @throws Interrupted if stopped; Error naming a required node that has ended
  void checkStop() const;
  /// @return false: not ready in time. @throws as checkStop()
  bool waitUntil(const std::function<bool()>& ready, double seconds) const;

  /// @throws Error naming the action if it fails; Interrupted after cancelling the goal
  template <class Action, class Goal>
  auto call(Client<Action>& client, const std::string& name, Goal goal, double timeout) const;
  /// @return false: no answer in time
  template <class Service>
  bool callService(const std::string& name, Service& service, double timeout) const;

  bool reachable() const { return program_.isServerConnected(); }  ///< cnc/run_program
  smartmill_msgs::CncState state() const;

  std::string arm(bool on, double timeout = SERVICE_WAIT);
  /// Runs a cut from the current position. @param extra_time [s] beyond the duration of the cut @return its
  /// conditions
  std::string run(const CutPlanner& planner, const PlannedCut& cut, double extra_time);
  /// Stops the spindle and disarms. @param hurry the program must end: short time limits
  std::string makeSafe(bool hurry);

 private:
  std::array<double, 3> restPosition() const;

  ros::NodeHandle nh_;
  std::function<bool()> stopped_;
  std::map<std::string, std::function<bool()>> is_alive_;  // required nodes
  Client<smartmill_msgs::RunProgramAction> program_;
  mutable std::mutex mutex_;
  smartmill_msgs::CncState state_;
  ros::Subscriber subscriber_;
};

template <class Action, class Goal>
auto MachineDriver::call(Client<Action>& client, const std::string& name, Goal goal, double timeout) const {
  static constexpr double GOAL_LEAD = 0.2;    // [s] from the present to the goal's stamp, for its delivery
  static constexpr double CANCEL_WAIT = 0.8;  // [s] for a cancelled goal to end
  checkStop();
  if (!client.isServerConnected()) throw Error(name + ": its node has ended");
  goal.header.stamp = ros::Time::now() + ros::Duration(GOAL_LEAD);
  client.sendGoal(goal);
  bool ended = false;
  std::string fault;
  try {
    ended = waitUntil(
        [&] {
          if (!client.isServerConnected()) fault = "its node has ended";
          return !fault.empty() || client.getState().isDone();
        },
        timeout);
  } catch (const Interrupted&) {
    client.cancelGoal();
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(CANCEL_WAIT);
    while (ros::ok() && !client.getState().isDone() && ros::SteadyTime::now() < end)
      ros::WallDuration(POLL).sleep();
    throw;
  }
  if (!fault.empty()) throw Error(name + ": " + fault);
  if (!ended) {
    client.cancelGoal();
    throw Error(name + ": no result within " + numberText(timeout, 0) + " s");
  }
  const auto result = client.getResult();
  const auto state = client.getState();
  if (!result || state != actionlib::SimpleClientGoalState::SUCCEEDED || result->code != 0) {
    const std::string message = result ? result->message : "";
    throw Error(name + ": " + (message.empty() ? state.toString() : message));
  }
  return *result;
}

template <class Service>
bool MachineDriver::callService(const std::string& name, Service& service, double timeout) const {
  // A service call has no time limit: if it takes too long, it continues in its detached thread.
  auto shared = std::make_shared<Service>(service);
  auto promise = std::make_shared<std::promise<bool>>();
  std::future<bool> answer = promise->get_future();
  std::thread([shared, promise, path = nh_.resolveName(name)] {
    promise->set_value(ros::service::call(path, *shared));
  }).detach();
  if (answer.wait_for(std::chrono::duration<double>(timeout)) != std::future_status::ready || !answer.get()) {
    return false;
  }
  service = *shared;
  return true;
}

}  // namespace smartmill::session
