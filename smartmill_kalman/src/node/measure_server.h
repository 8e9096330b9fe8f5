#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <actionlib/server/action_server.h>
#include <ros/ros.h>
#include <smartmill_msgs/Frf.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/ModalModel.h>

#include "smartmill_kalman/compensation/sorted_compensation.h"

namespace smartmill::kalman {

/// The action kalman/measure_frf around SortedCompensation: goals and cancels in, blows asked of daq/strike,
/// results out on tool/frf and tool/modes. All callbacks run in one thread; only the service call has its
/// own.
class MeasureServer {
 public:
  /// @param strikes false in a replay: no blow is asked for
  MeasureServer(ros::NodeHandle nh, SortedCompensation& sorted, bool strikes);
  ~MeasureServer();
  MeasureServer(const MeasureServer&) = delete;
  MeasureServer& operator=(const MeasureServer&) = delete;

  // Outputs of SortedCompensation come here.
  void strike(const StrikeCommand& command);
  void feedback(const TapFeedback& feedback);
  void finish(const SensorResult& result);
  void restart();

  /// Now and then: takes the answer of daq/strike. @param dead what is wrong with the streams; empty: nothing
  void poll(const std::string& dead);

  const std::string& lastMessage() const { return last_message_; }

 private:
  using Server = actionlib::ActionServer<smartmill_msgs::MeasureFrfAction>;
  struct Pending {
    Server::GoalHandle handle;
    ros::WallTime since;
    bool answered = false;
  };

  void onGoal(Server::GoalHandle handle);
  void onCancel(Server::GoalHandle handle);
  bool begin(const std::shared_ptr<Pending>& pending, bool free);
  void reject(Pending& pending, FrfCode code, const std::string& why);

  SortedCompensation& sorted_;
  bool strikes_;
  std::deque<std::shared_ptr<Pending>> waiting_;
  std::optional<Server::GoalHandle> active_;
  std::map<std::string, std::pair<smartmill_msgs::Frf, smartmill_msgs::ModalModel>> known_;  // by direction
  std::string last_message_ = "no measurement yet";
  ros::Publisher frf_, modes_;
  ros::ServiceClient client_;

  std::thread thread_;
  std::mutex mutex_;
  bool calling_ = false, by_hand_ = false;  // guarded, as the next
  std::string fault_;
  Server server_;
};

}  // namespace smartmill::kalman
