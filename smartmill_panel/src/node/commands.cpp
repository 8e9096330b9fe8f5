#include "node/commands.h"

#include <actionlib_msgs/GoalID.h>
#include <ros/console.h>
#include <ros/topic.h>
#include <smartmill_msgs/ArmMotion.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/FeedHold.h>
#include <smartmill_msgs/IdentifyCoefficientsActionGoal.h>
#include <smartmill_msgs/InstallModel.h>
#include <smartmill_msgs/MeasureFrfActionGoal.h>
#include <std_msgs/String.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_panel/server/command_gate.h"

namespace smartmill::panel {
namespace {

using nlohmann::json;

constexpr int BAD_REQUEST = 400, CONFLICT = 409;
constexpr int HITS = 5;

/// String value of a key as one line for the log; empty if missing.
std::string wordOf(const json& request, const char* key, std::size_t most = 200) {
  if (!request.is_object()) return {};
  const auto found = request.find(key);
  return found != request.end() && found->is_string() ? oneLine(found->get<std::string>(), most)
                                                      : std::string();
}

}  // namespace

PanelLog::PanelLog(ros::NodeHandle nh)
    : publisher_(nh.advertise<std_msgs::String>(names::PANEL_LOG, 100, true)) {
}

void PanelLog::write(const std::string& who, const std::string& from, const std::string& what) {
  std_msgs::String line;
  line.data = std::to_string(ros::Time::now().toSec()) + " " + who + " (" + from + "): " + what;
  publisher_.publish(line);
  ROS_INFO("panel: %s", line.data.c_str());
}

ApiResponse takeNote(const ApiRequest& request, PanelLog& log) {
  if (!request.post) return messageResponse(BAD_REQUEST, "a note requires POST");
  const json note = json::parse(request.body, nullptr, false);
  const std::string who = wordOf(note, "who", 40), text = wordOf(note, "text");
  if (text.empty()) return messageResponse(BAD_REQUEST, "text: expected a note");
  log.write(who.empty() ? "anonymous" : who, request.from, "mark: " + text);
  return messageResponse(200, text);
}

Commands::Commands(ros::NodeHandle nh, PanelLog& log)
    : nh_(std::move(nh)),
      measure_(nh_.advertise<smartmill_msgs::MeasureFrfActionGoal>(names::goals(names::MEASURE_TOOL_FRF), 1)),
      identify_(nh_.advertise<smartmill_msgs::IdentifyCoefficientsActionGoal>(
          names::goals(names::IDENTIFY_COEFFICIENTS), 1)),
      log_(log) {
  for (const char* action : {names::RUN_PROGRAM, names::JOG, names::ORIENT_SPINDLE, names::MEASURE_TOOL_FRF,
                             names::MEASURE_SENSOR_FRF, names::IDENTIFY_COEFFICIENTS, names::DISCOVER})
    cancels_[action] = nh_.advertise<actionlib_msgs::GoalID>(std::string(action) + "/cancel", 1);
}

ApiResponse Commands::run(const ApiRequest& command) {
  const json request = json::parse(command.body, nullptr, false);
  if (!request.is_object()) return messageResponse(BAD_REQUEST, "expected a JSON object");
  const auto word = [&](const char* key) { return wordOf(request, key); };
  const std::string name = word("command"), who = wordOf(request, "who", 40);
  if (who.empty()) return messageResponse(BAD_REQUEST, "who: expected a name for the log");
  std::string outcome;
  int status = 200;
  try {
    if (name == "cancel")
      outcome = cancel();
    else if (name == "disarm")
      outcome = disarm();
    else if (name == "hold")
      outcome = hold();
    else if (name == "install_model")
      outcome = install(word("file"));
    else if (name == "measure_frf")
      outcome = measure(word("direction"), word("tool"));
    else if (name == "identify")
      outcome = identify(word("tool"), word("material"));
    else
      throw Error("'" + oneLine(name, 40) + "' is not a command of the panel");
  } catch (const Error& error) {
    outcome = error.what();
    status = CONFLICT;
  }
  log_.write(who, command.from, name + (status == 200 ? ": " : " REFUSED: ") + outcome);
  return messageResponse(status, outcome);
}

// An empty goal id cancels all goals of an action.
std::string Commands::cancel() {
  for (auto& [action, publisher] : cancels_) publisher.publish(actionlib_msgs::GoalID());
  return "all running actions are cancelled";
}

std::string Commands::disarm() {
  smartmill_msgs::ArmMotion service;
  service.request.arm = false;
  if (!nh_.serviceClient<smartmill_msgs::ArmMotion>(names::ARM_MOTION).call(service))
    throw Error("the node of the controller does not answer");
  if (service.response.code != service.response.OK) throw Error(service.response.message);
  return service.response.message;
}

std::string Commands::hold() {
  smartmill_msgs::FeedHold service;
  if (!nh_.serviceClient<smartmill_msgs::FeedHold>(names::FEED_HOLD).call(service))
    throw Error("the node of the controller does not answer");
  if (service.response.code != service.response.OK) throw Error(service.response.message);
  return service.response.message;
}

std::string Commands::install(const std::string& file) {
  smartmill_msgs::InstallModel service;
  service.request.file = file;
  if (!nh_.serviceClient<smartmill_msgs::InstallModel>(names::INSTALL_MODEL).call(service))
    throw Error("the monitor does not answer");
  if (service.response.code != service.response.OK) throw Error(service.response.message);
  return service.response.message;
}

std::string Commands::measure(const std::string& direction, const std::string& tool) {
  if (direction != "x" && direction != "y") throw Error("direction: expected x or y");
  if (measure_.getNumSubscribers() == 0) throw Error("the hammer's node is not running");
  const auto state =
      ros::topic::waitForMessage<smartmill_msgs::CncState>(names::CNC_STATE, nh_, ros::Duration(2.0));
  if (!state || !state->connected || !state->armed) throw Error("motion is not armed");
  smartmill_msgs::MeasureFrfActionGoal goal;
  goal.header.stamp = goal.goal.header.stamp = ros::Time::now();
  goal.goal_id.id = "panel";
  goal.goal_id.stamp = goal.header.stamp;
  goal.goal.tool = tool;
  goal.goal.point = "tool_tip";
  goal.goal.direction = direction;
  goal.goal.hits = HITS;
  measure_.publish(goal);
  return "measurement of the tool's FRF in " + direction + " requested";
}

std::string Commands::identify(const std::string& tool, const std::string& material) {
  if (identify_.getNumSubscribers() == 0) throw Error("the load meter's node is not running");
  smartmill_msgs::IdentifyCoefficientsActionGoal goal;
  goal.header.stamp = goal.goal.header.stamp = ros::Time::now();
  goal.goal_id.id = "panel";
  goal.goal_id.stamp = goal.header.stamp;
  goal.goal.tool = tool;
  goal.goal.material = material;
  identify_.publish(goal);
  return "identification of the coefficients of " + material + " requested";
}

}  // namespace smartmill::panel
