#include "hammer_server.h"

#include <cmath>
#include <string>
#include <utility>

#include <smartmill_msgs/SpindleHealth.h>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"
#include "wiring.h"

namespace smartmill {
namespace hammer {
namespace {

constexpr double WATCH_PERIOD = 0.01;  // [s]

NodeParameters read(const ros::NodeHandle& private_nh) {
  NodeParameters parameters = parametersFromServer(private_nh).readAll<NodeParameters>();
  if (parameters.model.empty()) throw Error("model: the path of a smartmill-model/1 file is due");
  return parameters;
}

}  // namespace

HammerServer::HammerServer(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(read(private_nh)),
      shell_(nh, private_nh, "hammer", parameters_.stale_timeout),
      sorted_(parameters_.measurement, readMachineModel(parameters_.model), parameters_.hold_back,
              {[this](const Command& command) {
                 if (machine_) machine_->execute(command);
               },
               [this](const Feedback& f) { server_.feedback(f.stage, f.progress, f.hits_done); },
               [this](const MeasureFrfResult& result) { finish(result); },
               [this] {
                 if (machine_) machine_->forget();
                 server_.restart();
               }}),
      idle_(parameters_.hold_back,
            [this](const std::string& tool, const IdleRecord& seen) { tell(health_.turned(tool, seen)); }),
      streams_{sorted_, idle_},
      server_(nh, names::MEASURE_TOOL_FRF, "hammer",
              {[this](const MeasureFrfGoal& goal, std::function<bool(bool)> begin) {
                 sorted_.push(goal, std::move(begin));
               },
               [this](std::function<bool()> due) { sorted_.cancel(std::move(due)); }}) {
  // Not in a replay: an action client's constructor waits for the clock, and rosbag play waits for this
  // node's subscribers before it publishes one.
  if (parameters_.command_machine)
    machine_.emplace(nh, [this](const std::string& text) { sorted_.commandFailed(text); });
  health_publisher_ = nh.advertise<smartmill_msgs::SpindleHealth>(names::SPINDLE_HEALTH, 10);
  connect(shell_.inputs(), streams_);
  connectIdle(shell_.inputs(), idle_);
  shell_.diagnose("automatic hammer", [this](auto& status) { diagnose(status); });
  shell_.every(WATCH_PERIOD, [this] { watch(); });
}

void HammerServer::finish(const MeasureFrfResult& result) {
  if (result.code == FrfCode::ok) tell(health_.measured(result.modes));
  server_.finish({result.code, result.message, result.frf, result.modes, result.cross, result.sensitivity,
                  result.sensitivity_std, result.flute_sure, result.spindle_moves});
}

void HammerServer::tell(const std::optional<HealthReport>& report) {
  if (!report) return;
  smartmill_msgs::SpindleHealth message;
  message.header.stamp = fromSec(report->stamp);
  message.measured = report->measured;
  message.days = report->days;
  for (const HealthChange& c : report->changes) {
    smartmill_msgs::HealthChange change;
    change.quantity = c.what;
    change.first = c.before;
    change.now = c.now;
    change.deviations = std::isfinite(c.sigmas) ? c.sigmas : NOT_A_NUMBER;
    change.drifted = c.drifted();
    message.changes.push_back(change);
  }
  health_publisher_.publish(message);
}

void HammerServer::watch() {
  if (!machine_) {
    if (shell_.inputs().any().ended()) sorted_.flush();
    return;
  }
  machine_->pump();
  const InputHealth* dead = shell_.inputs().dead({names::HAMMER, names::CNC_STATE, names::SPINDLE_ANGLE});
  if (!dead) return;
  const std::string text =
      formatted("%s is silent for %.1f s", dead->topic().c_str(), dead->watchdog().silent());
  sorted_.lost(text);
  server_.refuseWaiting(text, parameters_.stale_timeout);
}

void HammerServer::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  status.summary(Level::OK, sorted_.measuring() ? "measuring" : "ready");
  if (const InputHealth* dead = shell_.inputs().dead({names::HAMMER, names::CNC_STATE, names::SPINDLE_ANGLE}))
    status.mergeSummary(Level::WARN, dead->topic() + " is silent");
  for (const std::string& warning : health_.warnings()) status.mergeSummary(Level::WARN, warning);
  status.add("late messages", sorted_.late());
  status.add("waiting for", sorted_.waitingFor());
  status.add("last measurement", server_.lastMessage());
}

}  // namespace hammer
}  // namespace smartmill

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<hammer::HammerServer>(argc, argv, "hammer");
}
