#include "node.h"

#include <cstdio>

#include <smartmill_msgs/DiscrepancyState.h>
#include <boost/function.hpp>

#include "smartmill_core/error.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill::discrepancy {
namespace {

constexpr int QUEUE = 2000;  // 20 s of blocks

MonitorParameters readParameters(const ros::NodeHandle& private_nh) {
  ParameterReader reader = ParameterReader::fromServer(private_nh);
  MonitorParameters p;
  reader.require("model", p.model);
  reader.read("length", p.length);
  reader.read("path_tolerance", p.path_tolerance);
  reader.read("hold_back", p.hold_back);
  reader.read("limit", p.limit);
  reader.read("record_folder", p.record_folder);
  reader.read("most_recorded", p.most_recorded);
  reader.finish();
  p.validate();
  return p;
}

}  // namespace

void MonitorParameters::validate() const {
  if (!(length > 0.1 && length <= 60.0))
    throw Error("length: " + std::to_string(length) + " s is outside 0.1 to 60");
  if (!(path_tolerance > 0.0))
    throw Error("path_tolerance: " + std::to_string(path_tolerance) + " m is not positive");
  if (!(hold_back >= 0.0)) throw Error("hold_back: " + std::to_string(hold_back) + " s is negative");
  if (!(limit > 1.0)) throw Error("limit: " + std::to_string(limit) + " is not above 1, the noise floor");
  if (most_recorded < 0) throw Error("most_recorded: " + std::to_string(most_recorded) + " is negative");
}

MonitorNode::MonitorNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(readParameters(private_nh)),
      model_(readMachineModel(parameters_.model)),
      stretches_(parameters_.length, parameters_.path_tolerance, parameters_.hold_back,
                 [this](const Stretch& stretch) { judge(stretch); }),
      diagnostics_(ros::NodeHandle(), private_nh) {
  state_ = nh.advertise<smartmill_msgs::DiscrepancyState>("discrepancy/state", 100);
  subscribe<smartmill_msgs::CuttingCondition>(nh, "cut/condition");
  subscribe<smartmill_msgs::CncState>(nh, "cnc/state");
  subscribe<smartmill_msgs::SpindleAngle>(nh, "spindle/angle");
  subscribe<smartmill_msgs::SampleBlock>(nh, "daq/dynamometer");
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
    last_ = liveGap(model_, stretch, parameters_.limit);
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
  if (last_.model_fits || parameters_.record_folder.empty() || recorded_ >= parameters_.most_recorded) return;
  recordStretch(model_, stretch, parameters_.record_folder);
  ++recorded_;
}

void MonitorNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  if (!problem_.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, problem_);
    return;
  }
  if (last_.channels.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "no steady stretch yet");
    return;
  }
  status.summary(
      last_.model_fits ? diagnostic_msgs::DiagnosticStatus::OK : diagnostic_msgs::DiagnosticStatus::WARN,
      last_.model_fits ? "model fits" : "model does not fit in " + last_.condition + ": run explain");
  for (std::size_t k = 0; k < last_.channels.size(); ++k)
    status.add("gap " + last_.channels[k], last_.gap[k]);
  status.add("stretches recorded", recorded_);
}

}  // namespace smartmill::discrepancy
