#include "node/tool_node.h"

#include <cmath>

#include <smartmill_msgs/ToolCondition.h>

#include "smartmill_core/error.h"
#include "smartmill_core/is_ready.h"
#include "smartmill_core/model/tool_files.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::program {
namespace {

constexpr double ANSWER_PERIOD = 0.1;  // [s]
constexpr double PERCENT = 100.0;

SharpTools toolsOf(const ToolNodeParameters& parameters) {
  if (parameters.model.empty()) return SharpTools({});
  if (parameters.model.find('=') != std::string::npos)
    return SharpTools(readToolModels(parameters.model, "model"));
  return SharpTools({{0, readMachineModel(parameters.model)}});
}

}  // namespace

ToolNode::ToolNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<ToolNodeParameters>()),
      shell_(nh, private_nh, "tool", parameters_.input_timeout),
      monitor_(parameters_.monitor, toolsOf(parameters_), parameters_.hold_back,
               [this](const ToolReport& report) { publish(report); }),
      publisher_(nh.advertise<smartmill_msgs::ToolCondition>(names::TOOL_CONDITION, STREAM_QUEUE, true)),
      new_tool_(nh.advertiseService(names::NEW_TOOL, &ToolNode::newTool, this)),
      hold_(nh.serviceClient<smartmill_msgs::FeedHold>(names::FEED_HOLD)) {
  if (monitor_.tool().teeth < 2)
    ROS_WARN("a tool with one tooth: its loss is not distinguished from the end of a cut");
  listen();
  shell_.diagnose("tool", [this](auto& status) { diagnose(status); });
  if (parameters_.hold_on_breakage) shell_.every(ANSWER_PERIOD, [this] { readAnswer(); });
}

void ToolNode::listen() {
  Inputs& inputs = shell_.inputs();
  feed<CncState>(inputs, names::CNC_STATE, monitor_);
  feed<SpindleAngle>(inputs, names::SPINDLE_ANGLE, monitor_);
  if (parameters_.force == "compensated") {
    feed<ForceBlock>(inputs, names::FORCE_COMPENSATED, monitor_);
  } else {
    feed<SampleBlock>(inputs, names::DYNAMOMETER, monitor_);
  }
  inputs.on<smartmill_msgs::CuttingCondition>(
      names::CUTTING_CONDITION,
      [this](const smartmill_msgs::CuttingCondition& message, double) { monitor_.push(fromMsg(message)); });
  inputs.on<CoefficientSet>(names::COEFFICIENTS,
                            [this](const CoefficientSet& set, double) { monitor_.tools().add(set); });
}

bool ToolNode::newTool(smartmill_msgs::NewTool::Request&, smartmill_msgs::NewTool::Response& response) {
  const std::string tool = last_.tool.empty() ? "" : " " + last_.tool;
  const std::string lost =
      last_.loss ? " the loss of tooth " + std::to_string(last_.loss->tooth + 1) + " and" : "";
  monitor_.newTool(ros::Time::now().toSec());
  response.message = "new tool" + tool + ":" + lost + " its cuts for the wear are forgotten";
  ROS_INFO("%s", response.message.c_str());
  return true;
}

void ToolNode::publish(const ToolReport& report) {
  last_ = report;
  smartmill_msgs::ToolCondition message;
  message.header.stamp = fromSec(report.stamp);
  message.condition = report.condition;
  message.tool = report.tool;
  message.teeth = static_cast<std::uint32_t>(report.teeth);
  message.broken = report.loss.has_value();
  const ToothLoss loss = report.loss.value_or(ToothLoss());
  const auto known = [&](double value) { return report.loss ? value : NOT_A_NUMBER; };
  message.tooth = report.loss ? static_cast<std::uint32_t>(loss.tooth + 1) : 0;
  if (report.loss) message.lost_at = fromSec(loss.lost_at);
  message.revolutions = known(loss.revolutions);
  message.loss = known(loss.loss);
  message.loss_std = known(loss.loss_std);
  message.log_likelihood_ratio = known(loss.log_likelihood_ratio);
  const CutWear wear = report.wear.value_or(CutWear());
  message.wear = report.wear ? PERCENT * wear.wear : NOT_A_NUMBER;
  message.wear_std = report.wear ? PERCENT * wear.wear_std : NOT_A_NUMBER;
  message.edge_wear = PERCENT * wear.edge_wear;
  message.edge_wear_std = PERCENT * wear.edge_wear_std;
  message.feed_per_tooth = report.wear ? wear.condition.engagement.feed_per_tooth : NOT_A_NUMBER;
  publisher_.publish(message);
  if (!report.new_loss) return;
  ROS_WARN("tooth %d of %d has lost %.0f +- %.0f %% of its force %.1f revolutions ago%s%s", loss.tooth + 1,
           report.teeth, PERCENT * loss.loss, PERCENT * loss.loss_std, loss.revolutions,
           report.condition.empty() ? "" : ", in ", report.condition.c_str());
  if (parameters_.hold_on_breakage) requestHold();
}

/// In a thread, since the bridge may take a while to answer; it decides whether motion is armed.
void ToolNode::requestHold() {
  if (answer_.valid()) return;
  answer_ = std::async(std::launch::async, [client = hold_]() mutable {
    smartmill_msgs::FeedHold call;
    if (!client.call(call)) {
      call.response.code = smartmill_msgs::FeedHold::Response::NOT_CONNECTED;
      call.response.message = "no answer from " + client.getService();
    }
    return call.response;
  });
}

void ToolNode::readAnswer() {
  if (!isReady(answer_)) return;
  const smartmill_msgs::FeedHold::Response answer = answer_.get();
  const bool held = answer.code == smartmill_msgs::FeedHold::Response::OK;
  answered_ = held ? "held" : "refused: " + answer.message;
  ROS_WARN("feed hold for the lost tooth: %s", answered_.c_str());
}

void ToolNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const char* force = parameters_.force == "compensated" ? names::FORCE_COMPENSATED : names::DYNAMOMETER;
  const InputHealth* dead = shell_.inputs().dead({names::SPINDLE_ANGLE, force});
  const std::optional<ToothLoss>& loss = monitor_.loss();
  if (loss) {
    status.summaryf(Level::ERROR, "tooth %d is lost", loss->tooth + 1);
  } else if (dead) {
    status.summary(Level::STALE, "no data on " + dead->topic());
  } else if (monitor_.tool().teeth < 2) {
    status.summary(Level::OK, "one tooth: its loss is not detected");
  } else {
    status.summary(Level::OK, "no tooth is lost");
  }
  if (loss) {
    status.add("tooth", loss->tooth + 1);
    status.add("share of the force lost [1]", loss->loss);
    status.add("its standard deviation [1]", loss->loss_std);
    status.add("revolutions until the report [1]", loss->revolutions);
  }
  if (last_.wear) {
    status.add("cut", last_.wear->condition.name);
    status.add("wear [%]", PERCENT * last_.wear->wear);
    status.add("standard deviation of the wear [%]", PERCENT * last_.wear->wear_std);
    status.add("wear of the edge coefficients [%]", PERCENT * last_.wear->edge_wear);
    status.add("its standard deviation [%]", PERCENT * last_.wear->edge_wear_std);
  }
  const CuttingCondition& condition = monitor_.condition();
  const std::optional<SharpCoefficients> sharp = monitor_.tools().of(condition);
  status.add("tool", condition.tool_name);
  status.add("coefficients of the sharp tool",
             sharp ? sharp->source
             : monitor_.tools().hasModel(condition) || condition.tool_name.empty()
                 ? std::string("not known")
                 : "not known, and no model has this tool");
  if (parameters_.hold_on_breakage) status.add("feed hold", answered_.empty() ? "not requested" : answered_);
}

}  // namespace smartmill::program

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<program::ToolNode>(argc, argv, "tool");
}
