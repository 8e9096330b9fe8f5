#include "node/node.h"

#include <algorithm>
#include <cmath>

#include <geometry_msgs/WrenchStamped.h>
#include <smartmill_msgs/ForceBlock.h>

#include "node/rotation.h"
#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::kalman {
namespace {

constexpr std::size_t MOST_WAITING = 2000;  // blocks, 20 s
constexpr double COLOURED = 0.5;            // [1] correlation of neighbouring innovations
constexpr double WATCH_PERIOD = 0.05;       // [s]
/// A goal that a dead stream holds back is refused after this.
constexpr double GOAL_PATIENCE = 1.0;  // [s]

ForceSensor sensorOf(const NodeParameters& parameters) {
  if (parameters.model.empty()) throw Error("model: the path of a smartmill-model/1 file is due");
  return readMachineModel(parameters.model).force_sensor;
}

}  // namespace

KalmanNode::KalmanNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<NodeParameters>()),
      listener_(transforms_),
      shell_(nh, private_nh, "force sensor", parameters_.input_timeout),
      measured_(nh.advertise<smartmill_msgs::ForceBlock>(names::FORCE_MEASURED, STREAM_QUEUE)),
      compensated_(nh.advertise<smartmill_msgs::ForceBlock>(names::FORCE_COMPENSATED, STREAM_QUEUE)),
      wrench_(nh.advertise<geometry_msgs::WrenchStamped>(names::FORCE_WRENCH, STREAM_QUEUE)),
      strike_(nh, parameters_.inSpindle() ? "tool" : POINT_FORCE_SENSOR),
      sorted_(parameters_.compensation, parameters_.taps, sensorOf(parameters_), parameters_.hold_back,
              {[this](const ForceBlock& m, const ForceBlock& c) { publish(m, c); },
               [this](const StrikeCommand& command) {
                 if (parameters_.command_machine) strike_.strike(command.direction);
               },
               [this](const TapFeedback& f) { measure_.feedback(f.stage, f.progress, f.hits_done); },
               [this](const SensorResult& r) {
                 FrfServer::Result result;
                 result.code = r.code;
                 result.message = r.message;
                 result.frf = r.frf;
                 result.modes = r.modes;
                 measure_.finish(result);
               },
               [this](const CalibrationResult& result) { calibrate_.finish(result); }}),
      measure_(nh, names::MEASURE_SENSOR_FRF, "kalman",
               {[this](const MeasureFrfGoal& goal, std::function<bool(bool)> begin) {
                  sorted_.push(goal, std::move(begin));
                },
                [this](std::function<bool()> due) {
                  sorted_.event([due](SensorMeasurement& m) {
                    if (due()) m.cancel();
                  });
                }}),
      calibrate_(nh, sorted_) {
  useFiles(sorted_, parameters_);
  if (parameters_.inSpindle() && parameters_.spindle_sensor.empty()) {
    sorted_.awaitCalibration();
    ROS_WARN("spindle_sensor: no calibration of the six sensors; they wait for kalman/calibrate");
  }
  sorted_.onRestart([this] {
    measure_.restart();
    calibrate_.restart();
  });
  listen();
  shell_.diagnose("force compensation", [this](auto& status) { diagnose(status); });
  shell_.every(WATCH_PERIOD, [this] { watch(); });
}

void KalmanNode::listen() {
  Inputs& inputs = shell_.inputs();
  inputs.on<smartmill_msgs::SampleBlock>(
      parameters_.force_input, [this](const smartmill_msgs::SampleBlock& message, double) {
        const std::string frame =
            message.header.frame_id.empty() ? frames::DYNAMOMETER : message.header.frame_id;
        if (frame != sensor_frame_) rotation_known_ = false;
        sensor_frame_ = frame;
        sorted_.push(fromMsg(message));
      });
  inputs.setWaiting(parameters_.force_input, [this] { return waiting_.size(); });
  connect(inputs, sorted_);
  feed<CuttingCondition>(inputs, names::CUTTING_CONDITION, sorted_);
  // A recording that began after the taps holds the modes that served in it.
  if (!parameters_.command_machine) feed<MeasuredModes>(inputs, names::TOOL_MODES, sorted_);
}

// The sensor is bolted to its table: its rotation is asked for once. Until it is known results wait, for
// the filters must not depend on when it came.
bool KalmanNode::findRotation() {
  try {
    const auto transform = transforms_.lookupTransform(frames::MACHINE, sensor_frame_, ros::Time(0));
    rotation_ = frames::rotationMatrix(transform.transform.rotation);
    return true;
  } catch (const tf2::TransformException& e) {
    ROS_WARN_THROTTLE(5.0, "no transform from %s to %s yet, force blocks wait: %s", sensor_frame_.c_str(),
                      frames::MACHINE, e.what());
    return false;
  }
}

void KalmanNode::publish(const ForceBlock& measured, const ForceBlock& compensated) {
  waiting_.emplace_back(measured, compensated);
  if (waiting_.size() > MOST_WAITING) waiting_.pop_front();
  publishWaiting();
}

void KalmanNode::publishWaiting() {
  if (waiting_.empty() || !(rotation_known_ || (rotation_known_ = findRotation()))) return;
  for (auto& [measured, compensated] : waiting_) {
    rotateInPlace(rotation_, measured.force);
    rotateInPlace(rotation_, compensated.force);
    measured_.publish(toMsg(measured, frames::MACHINE));
    compensated_.publish(toMsg(compensated, frames::MACHINE));
    publishWrench(compensated);
  }
  waiting_.clear();
}

void KalmanNode::publishWrench(const ForceBlock& block) {
  const double period = 1.0 / parameters_.wrench_rate;
  if (block.stamp < next_wrench_ - 2.0 * period) next_wrench_ = block.stamp;  // a bag was restarted
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    const double stamp = block.stamp + static_cast<double>(i) / block.sample_rate;
    if (stamp < next_wrench_) continue;
    next_wrench_ = std::max(next_wrench_ + period, stamp + 0.5 * period);
    geometry_msgs::WrenchStamped message;
    message.header.stamp = fromSec(stamp);
    message.header.frame_id = frames::MACHINE;
    message.wrench.force.x = block.force[0][i];
    message.wrench.force.y = block.force[1][i];
    message.wrench.force.z = block.force[2][i];
    wrench_.publish(message);
  }
}

void KalmanNode::watch() {
  watchMeasurement();
  publishWaiting();
  // End of data: nothing more will come to release what waits.
  if (shell_.inputs().watchdog(parameters_.force_input).ended()) sorted_.flush();
}

void KalmanNode::watchMeasurement() {
  if (const auto fault = strike_.takeFault()) {
    using Kind = StrikeClient::Answer::Kind;
    sorted_.event([fault](SensorMeasurement& m) {
      // Without an automatic hammer somebody hits by hand.
      if (fault->kind == Kind::failed) return m.commandFailed(fault->message);
      m.hitByHand();
    });
  }
  const InputHealth* dead = shell_.inputs().dead({names::HAMMER, parameters_.force_input.c_str()});
  if (!dead) return;
  const std::string text = dead->topic() + " is silent";
  if (shell_.inputs().watchdog(names::HAMMER).ended()) {
    sorted_.hammerLost(text);
  } else if (parameters_.command_machine && sorted_.measuring()) {
    sorted_.event([text](SensorMeasurement& m) { m.lost(text); });
    sorted_.flush();
  }
  if (parameters_.command_machine) measure_.refuseWaiting(text, GOAL_PATIENCE);
  calibrate_.lost(text);
}

std::pair<int, std::string> KalmanNode::judge(const SpindleSensorHealth* spindle) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const CompensationHealth& health = sorted_.health();
  const std::size_t invalid = spindle ? spindle->unloaded + spindle->overloaded : 0;
  const double zero =
      std::max({std::abs(health.zero[0]), std::abs(health.zero[1]), std::abs(health.zero[2])});
  // Told once, whatever came after.
  if (spindle && invalid != invalid_told_) {
    invalid_told_ = invalid;
    return {Level::ERROR,
            "a sensor of the spindle was unloaded or overloaded: those samples are no measurement"};
  }
  if (shell_.inputs().watchdog(parameters_.force_input).dead())
    return {Level::STALE, "no samples from the force sensor"};
  if (sorted_.uncalibrated()) return {Level::ERROR, "the spindle's sensors are not calibrated"};
  if (!rotation_known_) return {Level::ERROR, "no transform of the force sensor"};
  if (health.gaps + health.not_finite + health.clipped > 0)
    return {Level::WARN, "samples were lost, clipped or not numbers"};
  if (health.innovation_ratio > 3.0)
    return {Level::WARN, "innovations larger than the sensor model explains"};
  if (health.speed > 0.0 && health.colour > COLOURED) {
    return {Level::WARN,
            "innovations are not white: something of the force or of the sensor is not in the model"};
  }
  if (parameters_.drift_limit > 0.0 && zero > parameters_.drift_limit)
    return {Level::WARN, "the sensor's zero has drifted"};
  if (parameters_.model_max_age > 0.0 && sorted_.modesAge() > parameters_.model_max_age)
    return {Level::WARN, "the taps in use are old: measure the sensor again"};
  if (sorted_.measuring()) return {Level::OK, "measuring the sensor"};
  return {Level::OK, health.speed > 0.0 ? "compensating" : "passing through"};
}

void KalmanNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const CompensationHealth& health = sorted_.health();
  const SpindleSensorHealth* spindle = sorted_.spindleHealth();
  const auto [level, text] = judge(spindle);
  status.summary(static_cast<unsigned char>(level), text);
  status.add("spindle speed of the filters [rad/s]", health.speed);
  status.add("innovation over design [1]", health.innovation_ratio);
  status.add("colour of the innovations [1]", health.colour);
  status.addf("zero of the sensor [N]", "%.2f %.2f %.2f", health.zero[0], health.zero[1], health.zero[2]);
  status.add("age of the taps in use [s]", sorted_.modesAge());
  status.add("moves of the sensor's modes", health.moves);
  status.add("gaps", health.gaps);
  status.add("samples not numbers", health.not_finite);
  status.add("samples clipped", health.clipped);
  if (spindle) {
    status.add("samples with a sensor unloaded", spindle->unloaded);
    status.add("samples with a sensor overloaded", spindle->overloaded);
    status.add("least compression left [N]", spindle->least_left);
    status.add("uncertainty of the zero [N]", spindle->zero_std);
    status.addf("unbalance [g mm]", "%.3f %.3f %.3f", 1e6 * std::abs(spindle->unbalance[0]),
                1e6 * std::abs(spindle->unbalance[1]), 1e6 * std::abs(spindle->unbalance[2]));
    status.add("stretches in the air learnt", spindle->stretches);
  }
  status.add("inputs out of order", sorted_.late());
  status.add("waiting for", sorted_.waitingFor());
  status.add("last measurement of the sensor", measure_.lastMessage());
  status.add("last step of a calibration", calibrate_.lastMessage());
}

}  // namespace smartmill::kalman

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<kalman::KalmanNode>(argc, argv, "kalman");
}
