#include "node/monitor_node.h"

#include <cstdio>

#include <smartmill_msgs/DiscrepancyState.h>
#include <boost/function.hpp>

#include "smartmill_core/error.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill::discrepancy {
namespace {

constexpr int QUEUE = 100000;  // messages: a busy node catches up instead of losing some

MonitorParameters readParameters(const ros::NodeHandle& private_nh) {
  ParameterReader reader = ParameterReader::fromServer(private_nh);
  MonitorParameters p;
  reader.require("model", p.model);
  reader.read("length", p.stretch.length);
  reader.read("settle", p.stretch.settle);
  reader.read("path_tolerance", p.stretch.path_tolerance);
  reader.read("hold_back", p.hold_back);
  reader.read("limit", p.gap.limit);
  reader.read("load_step", p.gap.load_step);
  reader.read("record_folder", p.record_folder);
  reader.read("most_recorded", p.most_recorded);
  reader.read("most_per_condition", p.most_per_condition);
  reader.read("record_after", p.record_after);
  reader.finish();
  p.validate();
  return p;
}

}  // namespace

void MonitorParameters::validate() const {
  const auto wrong = [](const char* key, double value, const char* what) {
    throw Error(std::string(key) + ": " + std::to_string(value) + " " + what);
  };
  if (!(stretch.length > 0.1 && stretch.length <= 60.0))
    wrong("length", stretch.length, "s is outside 0.1 to 60");
  if (!(stretch.settle >= 0.0)) wrong("settle", stretch.settle, "s is negative");
  if (!(stretch.path_tolerance > 0.0)) wrong("path_tolerance", stretch.path_tolerance, "m is not positive");
  if (!(hold_back >= 0.0)) wrong("hold_back", hold_back, "s is negative");
  if (!(gap.limit > 1.0)) wrong("limit", gap.limit, "is not above 1, the noise floor");
  if (!(gap.load_step >= 0.0)) wrong("load_step", gap.load_step, "is negative");
  if (!(record_after >= 0.0)) wrong("record_after", record_after, "s is negative");
  if (most_recorded < 0) wrong("most_recorded", most_recorded, "is negative");
  if (most_per_condition < 0) wrong("most_per_condition", most_per_condition, "is negative");
}

MonitorNode::MonitorNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(readParameters(private_nh)),
      model_(readMachineModel(parameters_.model)),
      stretches_(parameters_.stretch, parameters_.hold_back,
                 [this](const Stretch& stretch) { judge(stretch); }),
      diagnostics_(ros::NodeHandle(), private_nh) {
  state_ = nh.advertise<smartmill_msgs::DiscrepancyState>("discrepancy/state", 100);
  subscribe<smartmill_msgs::CuttingCondition>(nh, "cut/condition");
  subscribe<smartmill_msgs::CncState>(nh, "cnc/state");
  subscribe<smartmill_msgs::SpindleAngle>(nh, "spindle/angle");
  subscribe<smartmill_msgs::SampleBlock>(nh, "daq/dynamometer");
  subscribe<smartmill_msgs::LoadSample>(nh, "cnc/load");
  diagnostics_.setHardwareID("none");
  diagnostics_.add("model fits", this, &MonitorNode::diagnose);
  timer_ = nh.createWallTimer(ros::WallDuration(1.0),
                              [this](const ros::WallTimerEvent&) { diagnostics_.update(); });
}

template <typename Message>
void MonitorNode::subscribe(ros::NodeHandle& nh, const char* topic) {
  const boost::function<void(const Message&)> callback = [this](const Message& message) {
    try {
      stretches_.push(fromMsg(message));
    } catch (const Error& error) {
      ROS_ERROR_THROTTLE(5.0, "%s", error.what());
    }
  };
  subscribers_.push_back(
      nh.subscribe<Message>(topic, QUEUE, callback, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay()));
}

void MonitorNode::judge(const Stretch& stretch) {
  try {
    last_ = liveGap(model_, stretch, parameters_.gap);
    problem_.clear();
  } catch (const Error& error) {
    problem_ = error.what();
    throw;
  }
  smartmill_msgs::DiscrepancyState message;
  message.header.stamp = fromSec(last_.stamp);
  message.condition = last_.condition;
  message.channels = last_.channels;
  message.gap = last_.gap;
  message.model_fits = last_.model_fits;
  state_.publish(message);
  diagnostics_.force_update();
  if (!last_.model_fits && !last_.at_the_edge) record(stretch);
}

void MonitorNode::record(const Stretch& stretch) {
  int& of_condition = recorded_of_[stretch.test.name];
  if (parameters_.record_folder.empty() || recorded_ >= parameters_.most_recorded ||
      of_condition >= parameters_.most_per_condition ||
      *stretch.test.running_before < parameters_.record_after)
    return;
  recordStretch(model_, stretch, parameters_.record_folder);
  ++recorded_;
  ++of_condition;
}

void MonitorNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  if (!problem_.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, problem_);
    return;
  }
  if (last_.condition.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "no steady stretch yet");
    return;
  }
  status.add("stretches recorded", recorded_);
  if (!last_.aside.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK,
                   "not compared: " + last_.condition + " " + last_.aside);
    return;
  }
  status.summary(
      last_.model_fits ? diagnostic_msgs::DiagnosticStatus::OK : diagnostic_msgs::DiagnosticStatus::WARN,
      last_.model_fits ? "model fits" : "model does not fit in " + last_.condition + ": run explain");
  for (std::size_t k = 0; k < last_.channels.size(); ++k)
    status.add("gap " + last_.channels[k], last_.gap[k]);
}

}  // namespace smartmill::discrepancy
