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

namespace smartmill::hammer {
namespace {

constexpr double CHECK_PERIOD = 0.01;  // [s]

NodeParameters read(const ros::NodeHandle& private_nh) {
  NodeParameters parameters = parametersFromServer(private_nh).readAll<NodeParameters>();
  if (parameters.model.empty()) throw Error("model: empty, expected the path of a smartmill-model/1 file");
  return parameters;
}

}  // namespace

HammerServer::HammerServer(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(read(private_nh)),
      shell_(nh, private_nh, "hammer", parameters_.stale_timeout),
      pipeline_(parameters_.measurement, readMachineModel(parameters_.model), parameters_.hold_back,
                {[this](const Command& command) {
                   if (machine_) machine_->execute(command);
                 },
                 [this](const Feedback& f) { server_.feedback(f.stage, f.progress, f.hits_done); },
                 [this](const MeasureFrfResult& result) { finish(result); },
                 [this] {
                   if (machine_) machine_->clear();
                   server_.restart();
                 }}),
      idle_(parameters_.hold_back,
            [this](const std::string& tool, const AirCutRecord& record) {
              publish(health_.addAirCut(tool, record));
            }),
      streams_{pipeline_, idle_},
      server_(nh, names::MEASURE_TOOL_FRF, "hammer",
              {[this](const MeasureFrfGoal& goal, std::function<bool(bool)> begin) {
                 pipeline_.push(goal, std::move(begin));
               },
               [this](std::function<bool()> applies) { pipeline_.cancel(std::move(applies)); }}) {
  // Not in a replay: the constructor of an action client waits for the clock, which rosbag play publishes
  // only once this node has subscribed.
  if (parameters_.command_machine)
    machine_.emplace(nh, [this](const std::string& text) { pipeline_.commandFailed(text); });
  health_publisher_ = nh.advertise<smartmill_msgs::SpindleHealth>(names::SPINDLE_HEALTH, 10);
  connect(shell_.inputs(), streams_);
  connectIdle(shell_.inputs(), idle_);
  shell_.diagnose("automatic hammer", [this](auto& status) { diagnose(status); });
  shell_.every(CHECK_PERIOD, [this] { checkInputs(); });
}

void HammerServer::finish(const MeasureFrfResult& result) {
  if (result.code == FrfCode::ok) publish(health_.addModes(result.modes));
  server_.finish({result.code, result.message, result.frf, result.modes, result.cross, result.sensitivity,
                  result.sensitivity_std, result.flute_confidence, result.spindle_moves});
}

void HammerServer::publish(const std::optional<HealthReport>& report) {
  if (!report) return;
  smartmill_msgs::SpindleHealth message;
  message.header.stamp = fromSec(report->stamp);
  message.measured = report->measured;
  message.days = report->days;
  for (const HealthChange& c : report->changes) {
    smartmill_msgs::HealthChange change;
    change.quantity = c.quantity;
    change.first = c.before;
    change.now = c.now;
    change.deviations = std::isfinite(c.sigmas) ? c.sigmas : NOT_A_NUMBER;
    change.drifted = c.drifted();
    message.changes.push_back(change);
  }
  health_publisher_.publish(message);
}

void HammerServer::checkInputs() {
  if (!machine_) {
    if (shell_.inputs().any().ended()) pipeline_.flush();
    return;
  }
  machine_->update();
  const InputHealth* dead = shell_.inputs().dead({names::HAMMER, names::CNC_STATE, names::SPINDLE_ANGLE});
  if (!dead) return;
  const std::string text =
      formatted("%s: no message for %.1f s", dead->topic().c_str(), dead->watchdog().silent());
  pipeline_.inputLost(text);
  server_.refuseWaiting(text, parameters_.stale_timeout);
}

void HammerServer::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  status.summary(Level::OK, pipeline_.isMeasuring() ? "measuring" : "ready");
  if (const InputHealth* dead = shell_.inputs().dead({names::HAMMER, names::CNC_STATE, names::SPINDLE_ANGLE}))
    status.mergeSummary(Level::WARN, dead->topic() + ": no messages");
  for (const std::string& warning : health_.warnings()) status.mergeSummary(Level::WARN, warning);
  status.add("late messages", pipeline_.lateMessages());
  status.add("waiting for", pipeline_.waitingFor());
  status.add("last measurement", server_.lastMessage());
}

}  // namespace smartmill::hammer

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<hammer::HammerServer>(argc, argv, "hammer");
}
