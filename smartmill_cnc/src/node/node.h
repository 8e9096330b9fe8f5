#pragma once

#include <actionlib/server/action_server.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "node/parameters.h"
#include "node/servo_publisher.h"
#include "smartmill_cnc/bridge.h"
#include "smartmill_msgs/ArmMotion.h"
#include "smartmill_msgs/FeedHold.h"
#include "smartmill_msgs/JogAction.h"
#include "smartmill_msgs/OrientSpindleAction.h"
#include "smartmill_msgs/RunProgramAction.h"
#include "smartmill_msgs/SetMacro.h"
#include "smartmill_msgs/SetOverrides.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::cnc {

/// ROS shell of the Bridge: one thread communicates with the controller; callbacks post jobs to it.
class CncNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error naming an invalid parameter.
  CncNode(ros::NodeHandle nh, ros::NodeHandle private_nh);
  /// Stops a running motion and closes the connection.
  ~CncNode();

 private:
  using Job = std::function<void()>;
  template <class Action>
  using Server = actionlib::ActionServer<Action>;

  /// The running goal, of any action.
  struct Active {
    std::string id;
    std::function<void(const Outcome&)> finish;
    std::function<void()> feedback;
  };

  void serveActions(ros::NodeHandle& nh);
  void run();
  void post(Job job);
  /// Calls a function in the bridge's thread. @return empty after `longest_call`
  template <class Result>
  std::optional<Result> callInThread(std::function<Result()> call);

  template <class Action, class Start, class Feedback>
  std::unique_ptr<Server<Action>> serve(ros::NodeHandle& nh, const std::string& name, Start start,
                                        Feedback feedback);

  void publish(const ros::Time& stamp);
  void publishConditions();
  void publishAlarms(const ros::Time& stamp);
  void log();
  using ArmEvent = ros::ServiceEvent<smartmill_msgs::ArmMotion::Request, smartmill_msgs::ArmMotion::Response>;
  using OverrideEvent =
      ros::ServiceEvent<smartmill_msgs::SetOverrides::Request, smartmill_msgs::SetOverrides::Response>;
  bool armMotion(ArmEvent& event);
  bool feedHold(smartmill_msgs::FeedHold::Request& request, smartmill_msgs::FeedHold::Response& response);
  bool setMacro(smartmill_msgs::SetMacro::Request& request, smartmill_msgs::SetMacro::Response& response);
  bool setOverrides(OverrideEvent& event);
  /// Adds a line to the motion log.
  void record(const std::string& client, const std::string& what);
  void writeLog(const std::function<void()>& write);
  /// Disarms when the client that armed motion has ended.
  void watchHolder();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  const NodeParameters parameters_;
  const std::vector<std::string> helpers_;
  MotionLog motion_log_;
  std::string recorded_holder_;                                   // the bridge's thread only
  const std::shared_ptr<linuxcnc::ServoStream> stream_;           // null without LinuxCNC
  Bridge bridge_;                                                 // the bridge's thread only
  std::optional<Active> active_;                                  // the bridge's thread only
  std::optional<std::vector<ControllerAlarm>> published_alarms_;  // the bridge's thread only

  ros::Publisher state_publisher_, load_publisher_, temperature_publisher_, condition_publisher_,
      alarms_publisher_;
  tf2_ros::TransformBroadcaster broadcaster_;
  ros::Time transform_stamp_;
  ros::ServiceServer arm_service_, hold_service_, macro_service_, override_service_;
  std::unique_ptr<Server<smartmill_msgs::RunProgramAction>> run_program_;
  std::unique_ptr<Server<smartmill_msgs::JogAction>> jog_;
  std::unique_ptr<Server<smartmill_msgs::OrientSpindleAction>> orient_;
  NodeShell shell_;
  std::unique_ptr<ServoPublisher> servo_;

  std::mutex mutex_;  // guards the members below
  std::vector<Job> jobs_;
  CncState diagnosed_state_;
  std::string diagnosed_line_, log_problem_;
  std::optional<ArmHolder> diagnosed_holder_;
  Poller::Counts diagnosed_connections_;

  std::atomic<double> round_trip_{0.0};  // [s] longest recent one
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace smartmill::cnc
