#pragma once

#include <deque>
#include <functional>
#include <string>

#include <actionlib/client/simple_action_client.h>
#include <ros/node_handle.h>
#include <smartmill_msgs/JogAction.h>
#include <smartmill_msgs/OrientSpindleAction.h>
#include <smartmill_msgs/RunProgramAction.h>

#include "smartmill_hammer/sequence/hammer_sequence.h"
#include "smartmill_ros/strike_client.h"

namespace smartmill::hammer {

/// Sends the commands of a measurement to the actions of the CNC bridge, one motion at a time, and to
/// daq/strike.
class MachineCommands {
 public:
  /// @param failed called with one line when a command fails
  MachineCommands(ros::NodeHandle nh, std::function<void(const std::string&)> failed);

  void execute(const Command& command);
  /// To be called periodically: sends the next motion and checks the hammer's reply.
  void update();
  /// Discards commands that wait.
  void clear() { waiting_.clear(); }

 private:
  template <class Action>
  using Client = actionlib::SimpleActionClient<Action>;

  void stop();
  template <class Action, class Goal>
  void send(Client<Action>& client, const char* name, const Goal& goal);
  void actionDone(const std::string& name, bool good, const std::string& message);

  std::function<void(const std::string&)> failed_;
  Client<smartmill_msgs::JogAction> jog_;
  Client<smartmill_msgs::OrientSpindleAction> orient_;
  Client<smartmill_msgs::RunProgramAction> program_;
  StrikeClient strike_;
  std::deque<Command> waiting_;
  std::string busy_with_;  // action in progress
  bool stopping_ = false;  // a failure is expected
};

}  // namespace smartmill::hammer
