#include "node/monitor_node.h"

#include <smartmill_msgs/DiscrepancyState.h>
#include <smartmill_msgs/ForceBlock.h>

#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::discrepancy {
namespace {

constexpr double INPUT_TIMEOUT = 1.0;  // [s]

MonitorParameters read(const ros::NodeHandle& private_nh) {
  MonitorParameters parameters = parametersFromServer(private_nh).readAll<MonitorParameters>();
  if (parameters.model.empty()) throw Error("model: expected the path of a smartmill-model/1 file");
  return parameters;
}

/// The compared forces must have the axes of the machine. @throws Error.
MachineModel readAligned(const std::string& file, ComparedForce compared) {
  MachineModel model = comparedModel(readMachineModel(file), compared);
  if (placedFrame(model.frames, frames::DYNAMOMETER, frames::MACHINE).isTurned())
    throw Error(file + ": frames.dynamometer is turned, expected an aligned one, or forces: compensated");
  return model;
}

}  // namespace

MonitorNode::MonitorNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : parameters_(read(private_nh)),
      model_(readAligned(parameters_.model, parameters_.compared())),
      shell_(nh, private_nh, "none", INPUT_TIMEOUT),
      segments_(parameters_.segment, parameters_.compared(), parameters_.hold_back,
                [this](const RecordSegment& segment) { evaluate(segment); }),
      state_(nh.advertise<smartmill_msgs::DiscrepancyState>(names::DISCREPANCY_STATE, 100)),
      force_(nh.advertise<smartmill_msgs::ForceBlock>(names::TWIN_FORCE, 100)),
      install_(nh.advertiseService(names::INSTALL_MODEL, &MonitorNode::install, this)) {
  connect(shell_.inputs(), segments_);
  shell_.diagnose("model fits", [this](auto& status) { diagnose(status); });
}

void MonitorNode::evaluate(const RecordSegment& segment) {
  try {
    last_ = liveGap(model_, segment, parameters_.gapOptions());
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
  publishForce(segment);
  shell_.tell();
  const bool keep = !last_.model_fits || (parameters_.record_all && last_.exclusion.empty());
  if (keep && !last_.near_limit) record(segment);
}

// Published with the stamps of the measurement, delayed by segment length and simulation.
void MonitorNode::publishForce(const RecordSegment& segment) {
  const Record& simulated = last_.simulated;
  if (simulated.size() == 0) return;
  ForceBlock block;
  block.sample_rate = segment.test.sample_rate;
  block.stamp = segment.stamp - static_cast<double>(simulated.size()) / block.sample_rate;
  block.first_index = simulated_;
  block.force = {simulated.column("fx"), simulated.column("fy"), simulated.column("fz")};
  simulated_ += simulated.size();
  const bool on_tool = parameters_.compared() == ComparedForce::compensated;
  force_.publish(toMsg(block, on_tool ? frames::MACHINE : frames::DYNAMOMETER));
}

void MonitorNode::record(const RecordSegment& segment) {
  if (hasOtherTool(segment, model_)) return;
  int& of_condition = recorded_of_[segment.test.name];
  if (parameters_.record_folder.empty() || recorded_ >= parameters_.most_recorded ||
      of_condition >= parameters_.most_per_condition ||
      *segment.test.running_before < parameters_.record_after)
    return;
  recordSegment(model_, segment, parameters_.record_folder);
  ++recorded_;
  ++of_condition;
}

// Services and streams use the same thread, so the model changes between two segments.
bool MonitorNode::install(smartmill_msgs::InstallModel::Request& request,
                          smartmill_msgs::InstallModel::Response& response) {
  try {
    MachineModel model = readAligned(request.file, parameters_.compared());
    if (!model.force_sensor.noise_rms)
      throw Error(request.file + ": force_sensor.noise_rms_n: not found, expected for the gap");
    model_ = std::move(model);
    response.message = "the monitor uses " + request.file;
    ROS_INFO("monitor: model changed to %s", request.file.c_str());
  } catch (const Error& error) {
    response.code = smartmill_msgs::InstallModel::Response::BAD_MODEL;
    response.message = error.what();
  }
  return true;
}

void MonitorNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  if (!problem_.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, problem_);
    return;
  }
  if (last_.condition.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "no steady segment yet");
    return;
  }
  status.add("segments recorded", recorded_);
  if (!last_.exclusion.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK,
                   "not compared: " + last_.condition + " " + last_.exclusion);
    return;
  }
  status.summary(
      last_.model_fits ? diagnostic_msgs::DiagnosticStatus::OK : diagnostic_msgs::DiagnosticStatus::WARN,
      last_.model_fits ? "model fits" : "model does not fit in " + last_.condition + ": run explain");
  for (std::size_t k = 0; k < last_.channels.size(); ++k)
    status.add("gap " + last_.channels[k], last_.gap[k]);
}

}  // namespace smartmill::discrepancy

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<discrepancy::MonitorNode>(argc, argv, "monitor");
}
