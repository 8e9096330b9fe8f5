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

namespace smartmill {
namespace hammer {

/// Hands the commands of a measurement to the CNC bridge's actions, one motion at a time, and to daq/strike.
class MachineCommands {
 public:
  /// @param failed told of a command that could not be done, one line
  MachineCommands(ros::NodeHandle nh, std::function<void(const std::string&)> failed);

  void execute(const Command& command);
  /// Now and then: the next motion, and what the hammer answered.
  void pump();
  /// What waits was meant for another run.
  void forget() { waiting_.clear(); }

 private:
  template <class Action>
  using Client = actionlib::SimpleActionClient<Action>;

  void stop();
  template <class Action, class Goal>
  void send(Client<Action>& client, const char* name, const Goal& goal);
  void done(const std::string& name, bool good, const std::string& message);

  std::function<void(const std::string&)> failed_;
  Client<smartmill_msgs::JogAction> jog_;
  Client<smartmill_msgs::OrientSpindleAction> orient_;
  Client<smartmill_msgs::RunProgramAction> program_;
  StrikeClient strike_;
  std::deque<Command> waiting_;
  std::string busy_with_;  // action that is running
  bool stopping_ = false;  // its failure is wanted
};

}  // namespace hammer
}  // namespace smartmill
