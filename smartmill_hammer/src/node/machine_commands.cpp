#include "machine_commands.h"

#include <utility>

#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::hammer {

MachineCommands::MachineCommands(ros::NodeHandle nh, std::function<void(const std::string&)> failed)
    : failed_(std::move(failed)),
      jog_(nh, names::JOG, false),
      orient_(nh, names::ORIENT_SPINDLE, false),
      program_(nh, names::RUN_PROGRAM, false),
      strike_(nh, "tool") {
}

void MachineCommands::execute(const Command& command) {
  switch (command.kind) {
    case Command::Kind::strike:
      return strike_.strike(command.direction);
    case Command::Kind::stop:
      return stop();
    default:
      waiting_.push_back(command);
      return update();
  }
}

void MachineCommands::stop() {
  waiting_.clear();
  if (busy_with_.empty()) return;
  stopping_ = true;
  if (busy_with_ == names::JOG) jog_.cancelGoal();
  if (busy_with_ == names::ORIENT_SPINDLE) orient_.cancelGoal();
  if (busy_with_ == names::RUN_PROGRAM) program_.cancelGoal();
}

template <class Action, class Goal>
void MachineCommands::send(Client<Action>& client, const char* name, const Goal& goal) {
  if (!client.isServerConnected())
    return failed_(std::string(name) + ": no server (is the CNC bridge running?)");
  busy_with_ = name;
  client.sendGoal(goal, [this, name = std::string(name)](const auto& state, const auto& result) {
    const bool good = state == actionlib::SimpleClientGoalState::SUCCEEDED && result && result->code == 0;
    actionDone(name, good, result && !result->message.empty() ? result->message : state.toString());
  });
}

// One motion at a time: the streams may indicate completion before the action does.
void MachineCommands::update() {
  if (const auto fault = strike_.takeFault()) failed_(fault->message);
  if (!busy_with_.empty() || waiting_.empty()) return;
  const Command command = std::move(waiting_.front());
  waiting_.pop_front();
  stopping_ = false;
  if (command.kind == Command::Kind::orient) {
    smartmill_msgs::OrientSpindleGoal goal;
    goal.angle = command.angle;
    send(orient_, names::ORIENT_SPINDLE, goal);
  } else if (command.kind == Command::Kind::jog) {
    smartmill_msgs::JogGoal goal;
    goal.axis = command.axis;
    goal.distance = command.distance;
    goal.feed = command.feed;
    send(jog_, names::JOG, goal);
  } else {
    smartmill_msgs::RunProgramGoal goal;
    goal.header.stamp = fromSec(command.stamp);
    goal.name = "hammer station";
    goal.program = moveProgram(command.from, command.path);
    goal.condition.kind = smartmill_msgs::CuttingCondition::NONE;
    send(program_, names::RUN_PROGRAM, goal);
  }
}

void MachineCommands::actionDone(const std::string& name, bool good, const std::string& message) {
  busy_with_.clear();  // update() sends the next command, not this callback of the client
  if (!good && !stopping_) failed_(name + ": " + message);
  stopping_ = false;
}

}  // namespace smartmill::hammer
