#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>

#include <actionlib/server/action_server.h>
#include <ros/ros.h>
#include <smartmill_msgs/CuttingCoefficients.h>
#include <smartmill_msgs/DiscoverAction.h>
#include <smartmill_msgs/DiscrepancyState.h>
#include <smartmill_msgs/ModalModel.h>

#include "session/machine_driver.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_launch/discovery/discovery_parameters.h"
#include "smartmill_launch/discovery/explained.h"
#include "smartmill_launch/discovery/installed_model.h"
#include "smartmill_ros/latched_topic.h"

namespace smartmill::session {

/// The action `discover`: runs cuts that the monitor records, runs `explain` on the records, makes the tests
/// that it suggests, and installs the improved model. One goal at a time, in its own thread.
class Discovery {
 public:
  using Parameters = discovery::DiscoveryParameters;
  /// @throws Error on an invalid parameter or model, or cuts that do not fit machine or stock.
  Discovery(ros::NodeHandle nh, const ros::NodeHandle& private_nh);
  ~Discovery() { stop(); }

  /// Cancels a running discovery and makes the machine safe, before the program ends. Requires running
  /// callbacks.
  void stop();

 private:
  using Server = actionlib::ActionServer<smartmill_msgs::DiscoverAction>;
  using Handle = Server::GoalHandle;
  using Result = smartmill_msgs::DiscoverResult;
  /// Ends a discovery with a code other than OK.
  struct Failure {
    std::uint8_t code;
    std::string message;
  };

  void onGoal(Handle handle);
  void onCancel(const Handle& handle);
  void work(Handle handle);
  void discover(const smartmill_msgs::DiscoverGoal& goal, Result& result);
  void finish(Handle& handle, const Result& result);

  void waitUntilReady();
  discovery::BelievedLimits believedLimits();
  void makeInitialCuts();
  void cut(const PlannedCut& cut);
  discovery::Explained explain(Result& result);
  bool makeSuggestedTest(const discovery::Explained::SuggestedTest& suggested_test,
                         const smartmill_msgs::DiscoverGoal& goal, Result& result);
  void install(Result& result);
  void publishModel(const MachineModel& model);
  void makeSafe(Result& result);
  void stage(const std::string& text);

  ros::NodeHandle nh_;
  Parameters parameters_;
  MachineModel model_;  // nominal model at the start of the node
  CutPlanner planner_;
  discovery::InstalledModel installed_model_;
  MachineDriver driver_;

  std::mutex mutex_;                 // guards the members up to thread_
  std::set<std::string> monitored_;  // conditions with a result of the monitor
  ros::SteadyTime last_monitored_;
  std::optional<Handle> active_;
  std::atomic<bool> cancel_{false}, stopping_{false};
  std::thread thread_;

  // Used by the thread only.
  std::size_t lane_ = 0, explained_ = 0, goals_ = 0;
  bool moved_ = false;
  smartmill_msgs::DiscoverFeedback feedback_;

  ros::Subscriber states_;
  ros::Publisher coefficients_;
  LatchedTopic<smartmill_msgs::ModalModel> modes_;
  ros::SteadyTimer publish_timer_;
  std::unique_ptr<Server> server_;
};

}  // namespace smartmill::session
