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
#include "smartmill_launch/discovery/model_place.h"
#include "smartmill_ros/latched_topic.h"

namespace smartmill::session {

/// The action `discover`: cuts while the monitor watches, lets `explain` say why the machine differs, makes
/// the tests that it asks for, and installs the improved model. One goal at a time, in a thread of its own.
class Discovery {
 public:
  using Parameters = discovery::DiscoveryParameters;
  /// @throws Error on a wrong parameter or model, or cuts that do not fit.
  Discovery(ros::NodeHandle nh, const ros::NodeHandle& private_nh);
  ~Discovery() { stop(); }

  /// The program is to end: a running discovery is cancelled, the machine made safe. Callbacks go on
  /// meanwhile.
  void stop();

 private:
  using Server = actionlib::ActionServer<smartmill_msgs::DiscoverAction>;
  using Handle = Server::GoalHandle;
  using Result = smartmill_msgs::DiscoverResult;
  /// An end that is not OK.
  struct Failure {
    std::uint8_t code;
    std::string why;
  };

  void onGoal(Handle handle);
  void onCancel(const Handle& handle);
  void work(Handle handle);
  void discover(const smartmill_msgs::DiscoverGoal& goal, Result& result);
  void finish(Handle& handle, const Result& result);

  void ready();
  void watch();
  void cut(const PlannedCut& cut);
  discovery::Explained explain(Result& result);
  bool makeWanted(const discovery::Explained::Wanted& wanted, const smartmill_msgs::DiscoverGoal& goal,
                  Result& result);
  void install(Result& result);
  void tellCharts(const MachineModel& model);
  void makeSafe(Result& result);
  void stage(const std::string& text);

  ros::NodeHandle nh_;
  Parameters parameters_;
  MachineModel model_;  // as believed when the node started
  CutPlanner planner_;
  discovery::ModelPlace place_;
  MachineDriver driver_;

  std::mutex mutex_;              // of what the callbacks share with the thread
  std::set<std::string> judged_;  // conditions
  ros::WallTime last_judged_;
  std::optional<Handle> active_;
  std::atomic<bool> cancel_{false}, stopping_{false};
  std::thread thread_;

  // Of the thread.
  std::size_t lane_ = 0, explained_ = 0, goals_ = 0;
  bool moved_ = false;
  smartmill_msgs::DiscoverFeedback feedback_;

  ros::Subscriber states_;
  ros::Publisher coefficients_;
  LatchedTopic<smartmill_msgs::ModalModel> modes_;
  ros::WallTimer tell_;
  std::unique_ptr<Server> server_;
};

}  // namespace smartmill::session
