#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <actionlib/client/simple_action_client.h>
#include <ros/ros.h>
#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/IdentifyCoefficientsAction.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/RunProgramAction.h>
#include <smartmill_msgs/StabilityChart.h>

#include "session_parameters.h"
#include "session_summary.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_launch/session/session_plan.h"

namespace smartmill::session {

/// Takes the whole job through in order, speaking only actions and services of the other nodes.
class Session {
 public:
  /// @param stop set by a signal: goals are cancelled, motion disarmed. @throws Error on a wrong parameter or
  /// a job that does not fit the machine.
  Session(ros::NodeHandle nh, const ros::NodeHandle& private_nh, const std::atomic<bool>& stop);
  ~Session();

  /// @return exit code of the program.
  int run();

 private:
  template <class Action>
  using Client = actionlib::SimpleActionClient<Action>;

  void job();
  void step(const std::string& name, const std::function<std::string()>& work);
  void say(const char* mark, const std::string& name, const std::string& detail);
  void pause(double seconds) const;
  void checkStop() const;
  bool waitUntil(const std::function<bool()>& ready, double seconds) const;

  template <class Action, class Goal>
  auto call(Client<Action>& client, const std::string& name, Goal goal, double timeout);
  template <class Service>
  bool ask(const std::string& name, Service& service, double timeout) const;

  std::string waitReady();
  std::string arm(bool on, double timeout);
  std::string measure(Client<smartmill_msgs::MeasureFrfAction>& client, const std::string& name,
                      const std::string& point, const std::string& direction, int hits, int modes);
  std::string runCut(const PlannedCut& cut);
  void waitVerdict();
  void runProgram(const std::string& name, const std::string& program,
                  const std::optional<CuttingCondition>& condition, double timeout);
  std::string identify(bool reset);
  std::string waitChart();
  std::string choose();
  std::string verify(const char* role, const PlannedCut& cut, CutVerdict::Kind due);
  void makeSafe();
  std::string missing() const;
  std::string recorderMissing() const;

  ros::NodeHandle nh_;
  const std::atomic<bool>& stop_;
  SessionParameters parameters_;
  MachineModel model_;
  SessionPlan plan_;
  SessionSummary summary_;
  ros::WallTime begin_;
  bool armed_ = false;

  Client<smartmill_msgs::MeasureFrfAction> tool_frf_, sensor_frf_;
  Client<smartmill_msgs::IdentifyCoefficientsAction> identify_;
  Client<smartmill_msgs::RunProgramAction> program_;
  std::vector<ros::Subscriber> subscribers_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;

  mutable std::mutex mutex_;  // of what subscribers write
  std::map<std::string, ros::WallTime> heard_;
  smartmill_msgs::CncState state_;
  std::optional<smartmill_msgs::StabilityChart> chart_;
  std::map<std::string, std::vector<ChatterWindow>> windows_;  // by condition
  std::optional<smartmill_msgs::ChatterState> verdict_;        // the newest

  ros::Time cut_from_;
  ros::Time coefficients_stamp_;
  smartmill_msgs::StabilityChart used_chart_;
  Point stable_, unstable_;
};

}  // namespace smartmill::session
