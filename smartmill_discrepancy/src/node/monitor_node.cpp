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
  if (parameters.model.empty()) throw Error("model: the path of a smartmill-model/1 file is due");
  return parameters;
}

}  // namespace

MonitorNode::MonitorNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : parameters_(read(private_nh)),
      model_(readMachineModel(parameters_.model)),
      shell_(nh, private_nh, "none", INPUT_TIMEOUT),
      stretches_(parameters_.stretch, parameters_.hold_back,
                 [this](const Stretch& stretch) { judge(stretch); }),
      state_(nh.advertise<smartmill_msgs::DiscrepancyState>(names::DISCREPANCY_STATE, 100)),
      force_(nh.advertise<smartmill_msgs::ForceBlock>(names::TWIN_FORCE, 100)),
      install_(nh.advertiseService(names::INSTALL_MODEL, &MonitorNode::install, this)) {
  connect(shell_.inputs(), stretches_);
  shell_.diagnose("model fits", [this](auto& status) { diagnose(status); });
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
  publishForce(stretch);
  shell_.tell();
  const bool wanted = !last_.model_fits || (parameters_.record_all && last_.aside.empty());
  if (wanted && !last_.at_the_edge) record(stretch);
}

// Late by the stretch and its simulation, with the stamps of what was measured.
void MonitorNode::publishForce(const Stretch& stretch) {
  const Record& simulated = last_.simulated;
  if (simulated.size() == 0) return;
  ForceBlock block;
  block.sample_rate = stretch.test.sample_rate;
  block.stamp = stretch.stamp - static_cast<double>(simulated.size()) / block.sample_rate;
  block.first_index = simulated_;
  block.force = {simulated.column("fx"), simulated.column("fy"), simulated.column("fz")};
  simulated_ += simulated.size();
  force_.publish(toMsg(block, frames::DYNAMOMETER));
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

// Between two stretches: services and streams come in the same thread.
bool MonitorNode::install(smartmill_msgs::InstallModel::Request& request,
                          smartmill_msgs::InstallModel::Response& response) {
  try {
    MachineModel model = readMachineModel(request.file);
    if (!model.force_sensor.noise_rms)
      throw Error(request.file + ": force_sensor.noise_rms_n is missing (needed to measure a gap)");
    model_ = std::move(model);
    response.message = "the monitor follows " + request.file;
    ROS_INFO("monitor: model is %s now", request.file.c_str());
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

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<discrepancy::MonitorNode>(argc, argv, "monitor");
}
