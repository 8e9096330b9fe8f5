#include "node/node.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>

#include <geometry_msgs/WrenchStamped.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/ForceSensorState.h>

#include "node/rotation.h"
#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_recording/conversion/fields.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::kalman {
namespace {

constexpr std::size_t MAX_WAITING = 4000;  // blocks that wait for the rotation: 20 s of both topics
constexpr double MAX_CORRELATION = 0.5;    // [1] of neighbouring innovations
constexpr double CHECK_PERIOD = 0.05;      // [s]
constexpr double GOAL_TIMEOUT = 1.0;       // [s] before a goal that waits for a dead input is refused

MachineModel modelOf(const NodeParameters& parameters) {
  if (parameters.model.empty()) throw Error("model: empty, expected the path of a smartmill-model/1 file");
  return readMachineModel(parameters.model);
}

// A corner radius shortens the lever of the force.
bool canCheckTorque(const MachineModel& model) {
  return model.spindle && model.spindle->load_meter_full_scale &&
         std::none_of(model.effects.begin(), model.effects.end(),
                      [](const EffectEntry& effect) { return effect.name == "corner_radius"; });
}

}  // namespace

KalmanNode::KalmanNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<NodeParameters>()),
      listener_(transforms_),
      shell_(nh, private_nh, "force sensor", parameters_.input_timeout),
      measured_(nh.advertise<smartmill_msgs::ForceBlock>(names::FORCE_MEASURED, STREAM_QUEUE)),
      compensated_(nh.advertise<smartmill_msgs::ForceBlock>(names::FORCE_COMPENSATED, STREAM_QUEUE)),
      wrench_(nh.advertise<geometry_msgs::WrenchStamped>(names::FORCE_WRENCH, STREAM_QUEUE)),
      sensor_state_(nh.advertise<smartmill_msgs::ForceSensorState>(names::FORCE_SENSOR, 10, true)),
      strike_(nh, parameters_.kind() == ForceSensorKind::spindle ? "tool" : POINT_FORCE_SENSOR),
      model_(modelOf(parameters_)),
      pipeline_(parameters_.compensationOfSensor(), parameters_.taps, model_.force_sensor,
                parameters_.hold_back, pipelineOutputs()),
      measurement_server_(nh, names::MEASURE_SENSOR_FRF, "kalman", measurementHandlers()),
      calibration_server_(nh, pipeline_, parameters_.command_machine) {
  loadSensorFiles(pipeline_, parameters_);
  if (canCheckTorque(model_)) pipeline_.checkTorque(*model_.spindle);
  if (pipeline_.forces().isUncalibrated())
    ROS_WARN("%s", pipeline_.identification().calibration().message.c_str());
  publishSensor();
  for (const MeasuredModes& modes : measurement_server_.modes()) {
    ROS_INFO("modes in %s from before the restart", modes.direction.c_str());
    pipeline_.push(modes);
  }
  subscribe();
  shell_.diagnose("force compensation", [this](auto& status) { diagnose(status); });
  shell_.every(CHECK_PERIOD, [this] { checkInputs(); });
}

CompensationPipeline::Outputs KalmanNode::pipelineOutputs() {
  CompensationPipeline::Outputs outputs;
  outputs.force = {[this](const ForceBlock& block) { enqueue(measured_, block); },
                   [this](const ForceBlock& block) { enqueue(compensated_, block); }};
  outputs.strike = [this](const StrikeCommand& command) {
    if (parameters_.command_machine) strike_.strike(command.direction);
  };
  outputs.feedback = [this](const TapFeedback& feedback) {
    measurement_server_.feedback(feedback.stage, feedback.progress, feedback.hits_done);
  };
  outputs.result = [this](const SensorResult& sensor) {
    FrfServer::Result result;
    result.code = sensor.code;
    result.message = sensor.message;
    result.frf = sensor.frf;
    result.modes = sensor.modes;
    measurement_server_.finish(result);
  };
  outputs.calibration = [this](const CalibrationResult& result) {
    publishSensor();
    calibration_server_.finish(result);
  };
  outputs.restart = [this] {
    measurement_server_.restart();
    calibration_server_.restart();
    publishSensor();
  };
  outputs.block_error = [this](const std::string& reason) {
    ++failed_blocks_;
    last_failure_ = force_input_ + ": block not compensated: " + reason;
    ROS_ERROR_STREAM_THROTTLE(5.0, last_failure_);
  };
  return outputs;
}

FrfServer::Handlers KalmanNode::measurementHandlers() {
  return {[this](const MeasureFrfGoal& goal, std::function<bool(bool)> begin) {
            pipeline_.push(goal, std::move(begin));
          },
          [this](std::function<bool()> is_active) {
            pipeline_.event([is_active](SensorMeasurement& measurement) {
              if (is_active()) measurement.end(FrfCode::cancelled, "cancelled");
            });
          }};
}

void KalmanNode::subscribe() {
  Inputs& inputs = shell_.inputs();
  inputs.on<FramedBlock>(force_input_, [this](const FramedBlock& framed, double) {
    const std::string frame = framed.frame.empty() ? frames::DYNAMOMETER : framed.frame;
    if (frame != sensor_frame_) rotation_known_ = false;
    sensor_frame_ = frame;
    pipeline_.push(framed.block);
  });
  // One input block becomes two output blocks.
  inputs.setWaiting(force_input_, [this] { return (waiting_.size() + 1) / 2; });
  connect(inputs, pipeline_);
  feed<CuttingCondition>(inputs, names::CUTTING_CONDITION, pipeline_);
  feed<LoadSample>(inputs, names::CNC_LOAD, pipeline_);
  // A recording that starts after the taps contains the modes that were used in it.
  if (!parameters_.command_machine) feed<MeasuredModes>(inputs, names::TOOL_MODES, pipeline_);
}

// The sensor is fixed to its table: its rotation is looked up once. Blocks wait until then, so that the
// filters do not depend on when the transform arrives.
bool KalmanNode::lookUpRotation() {
  try {
    const auto transform = transforms_.lookupTransform(frames::MACHINE, sensor_frame_, ros::Time(0));
    rotation_ = frames::rotationMatrix(transform.transform.rotation);
    if (TorqueCheck* check = pipeline_.torqueCheck()) check->setRotation(rotation_);
    return true;
  } catch (const tf2::TransformException& e) {
    ROS_WARN_THROTTLE(5.0, "no transform from %s to %s, force blocks wait: %s", sensor_frame_.c_str(),
                      frames::MACHINE, e.what());
    return false;
  }
}

void KalmanNode::enqueue(ros::Publisher& publisher, const ForceBlock& block) {
  waiting_.emplace_back(&publisher, block);
  if (waiting_.size() > MAX_WAITING) {
    waiting_.pop_front();
    ++dropped_blocks_;
    ROS_ERROR_THROTTLE(5.0, "%s: %zu force blocks dropped: no transform from %s to %s", force_input_.c_str(),
                       dropped_blocks_, sensor_frame_.c_str(), frames::MACHINE);
  }
  publishWaiting();
}

void KalmanNode::publishWaiting() {
  if (waiting_.empty() || !(rotation_known_ || (rotation_known_ = lookUpRotation()))) return;
  for (auto& [publisher, block] : waiting_) {
    rotateInPlace(rotation_, block.force);
    publisher->publish(toMsg(block, frames::MACHINE));
    if (publisher == &compensated_) publishWrench(block);
  }
  waiting_.clear();
}

void KalmanNode::publishWrench(const ForceBlock& block) {
  const double period = 1.0 / parameters_.wrench_rate;
  if (block.stamp < next_wrench_ - 2.0 * period) next_wrench_ = block.stamp;  // recording restarted
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

void KalmanNode::publishSensor() {
  const SensorCalibrationState& state = pipeline_.identification().calibration();
  smartmill_msgs::ForceSensorState message;
  message.header.stamp = fromSec(state.stamp);
  message.sensor = forceSensorWords()[static_cast<std::size_t>(parameters_.kind())];
  message.calibrated = state.calibrated;
  message.message = state.message;
  message.readings = static_cast<std::uint32_t>(state.readings);
  conversion::setPoint(state.constant, message.constant);
  conversion::setPoint(state.constant_std, message.constant_std);
  conversion::setPoint(state.error, message.error);
  message.verified = state.verified;
  sensor_state_.publish(message);
}

void KalmanNode::checkInputs() {
  checkMeasurement();
  checkAngles();
  checkTorque();
  publishWaiting();
  // End of data: no later input releases the blocks that wait.
  if (shell_.inputs().watchdog(force_input_).ended()) pipeline_.flush();
}

// Blocks wait for angles until these have been silent while blocks came.
void KalmanNode::checkAngles() {
  const Watchdog& blocks = shell_.inputs().watchdog(force_input_);
  const double silent = shell_.inputs().watchdog(names::SPINDLE_ANGLE).silent();
  if (!blocks.ever() || blocks.dead()) {
    blocks_from_ = silent;
  } else if (silent < blocks_from_) {
    blocks_from_ = 0.0;
  }
  if (silent - blocks_from_ > parameters_.input_timeout) pipeline_.anglesStopped();
}

void KalmanNode::checkTorque() {
  TorqueCheck* check = pipeline_.torqueCheck();
  const std::string line = check ? check->takeLine() : "";
  if (!line.empty()) ROS_ERROR_STREAM(force_input_ << ": " << line);
}

void KalmanNode::checkMeasurement() {
  if (const auto fault = strike_.takeFault()) {
    using Kind = StrikeClient::Answer::Kind;
    pipeline_.event([fault](SensorMeasurement& measurement) {
      if (fault->kind == Kind::failed) return measurement.end(FrfCode::no_hit, fault->message);
      measurement.hitByHand();  // no automatic hammer
    });
  }
  const InputHealth* dead = shell_.inputs().dead({names::HAMMER, force_input_.c_str()});
  if (!dead) return;
  const std::string reason = "no data on " + dead->topic();
  if (shell_.inputs().watchdog(names::HAMMER).ended()) {
    pipeline_.hammerStopped(reason);
  } else if (parameters_.command_machine && pipeline_.identification().isMeasuring()) {
    pipeline_.event([reason](SensorMeasurement& measurement) { measurement.end(FrfCode::bad_data, reason); });
    pipeline_.flush();
  }
  if (parameters_.command_machine) measurement_server_.refuseWaiting(reason, GOAL_TIMEOUT);
  calibration_server_.abort(reason);
}

std::pair<int, std::string> KalmanNode::summary(const SpindleSensorHealth* spindle) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const CompensationHealth health = pipeline_.forces().health();
  // Events between two publications of the diagnostics are reported once, whatever the present state.
  const std::size_t invalid = spindle ? spindle->unloaded + spindle->overloaded : 0;
  if (std::exchange(reported_invalid_, invalid) != invalid)
    return {Level::ERROR, "a sensor in the spindle was unloaded or overloaded: its samples are invalid"};
  if (std::exchange(reported_failures_, failed_blocks_) != failed_blocks_)
    return {Level::ERROR, last_failure_};
  if (std::exchange(reported_drops_, dropped_blocks_) != dropped_blocks_)
    return {Level::ERROR, "force blocks were dropped: no transform of the force sensor for 20 s"};
  if (shell_.inputs().watchdog(force_input_).dead())
    return {Level::STALE, "no samples from the force sensor"};
  if (const StreamCheck::Unchanged stuck = shell_.inputs().unchanged(force_input_);
      stuck.duration > parameters_.input_timeout) {
    const std::string text = force_input_ + formatted(": channel %s has not changed for %.1f s: stuck",
                                                      stuck.channel.c_str(), stuck.duration);
    ROS_ERROR_STREAM_THROTTLE(5.0, text);
    return {Level::ERROR, text};
  }
  if (const TorqueCheck* check = pipeline_.torqueCheck(); check && check->disagrees())
    return {Level::ERROR, force_input_ + ": mean force and load meter disagree"};
  if (pipeline_.forces().isUncalibrated())
    return {Level::ERROR, pipeline_.identification().calibration().message};
  if (!rotation_known_) return {Level::ERROR, "no transform of the force sensor"};
  if (health.gaps + health.not_finite + health.clipped > 0)
    return {Level::WARN, "samples were lost, clipped or not finite"};
  if (health.innovation_ratio > parameters_.compensation.innovation_limit)
    return {Level::WARN, "innovations larger than the sensor model explains"};
  if (health.speed > 0.0 && health.innovation_correlation > MAX_CORRELATION)
    return {Level::WARN, "innovations are not white: the model misses part of the force or of the sensor"};
  const double zero =
      std::max({std::abs(health.zero[0]), std::abs(health.zero[1]), std::abs(health.zero[2])});
  if (parameters_.drift_limit > 0.0 && zero > parameters_.drift_limit)
    return {Level::WARN, "the zero of the sensor has drifted beyond drift_limit"};
  if (parameters_.model_max_age > 0.0 && pipeline_.ageOfModes() > parameters_.model_max_age)
    return {Level::WARN, "the measured modes are older than model_max_age: repeat the taps"};
  if (pipeline_.identification().isMeasuring()) return {Level::OK, "measuring the sensor"};
  if (pipeline_.forces().invertsMatrix()) return {Level::OK, "inverting the matrix of the plate"};
  return {Level::OK, health.speed > 0.0 ? "compensating" : "passing through"};
}

void KalmanNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const CompensationHealth health = pipeline_.forces().health();
  const SpindleSensorHealth* spindle = pipeline_.forces().spindle().health();
  const auto [level, text] = summary(spindle);
  status.summary(static_cast<unsigned char>(level), text);
  status.add("force model", pipeline_.forces().forceModel());
  status.add("spindle speed of the filters [rad/s]", health.speed);
  status.add("standard deviation of the estimated speed [rad/s]", health.speed_std);
  status.add("blocks with an estimated speed", health.estimated_blocks);
  status.add("innovation ratio [1]", health.innovation_ratio);
  status.add("correlation of the innovations [1]", health.innovation_correlation);
  status.addf("zero of the sensor [N]", "%.2f %.2f %.2f", health.zero[0], health.zero[1], health.zero[2]);
  const MemorySchedule& memory = pipeline_.forces().memory();
  status.add("spindle speeds with tuned process noise", memory.axis[0].size());
  if (memory.error(0, health.speed)) {
    status.addf("expected RMS force error [N]", "%.2f %.2f %.2f", *memory.error(0, health.speed),
                *memory.error(1, health.speed), *memory.error(2, health.speed));
  }
  if (const TorqueCheck* check = pipeline_.torqueCheck())
    status.add("torque by the force over that of the load meter [1]", check->ratio());
  status.add("age of the measured modes [s]", pipeline_.ageOfModes());
  status.add("updates of the sensor's modes", health.mode_updates);
  status.add("gaps", health.gaps);
  status.add("samples not finite", health.not_finite);
  status.add("samples clipped", health.clipped);
  status.add("blocks not compensated", failed_blocks_);
  status.add("blocks waiting for a transform", waiting_.size());
  status.add("blocks dropped for want of a transform", dropped_blocks_);
  if (const ChannelForces* channels = pipeline_.channels()) {
    status.add("channels of the sensor", channels->channels());
    status.add("condition number of the channels [1]", channels->condition());
    static constexpr const char* UNITS[] = {"N", "N m"};
    for (std::size_t c = 0; c < channels->deviations().size(); ++c) {
      status.add(formatted("standard deviation of %s [%s]", PLATE_CHANNELS[c], UNITS[c / 3]),
                 channels->deviations()[c]);
    }
  }
  if (spindle) {
    status.add("samples with a sensor unloaded", spindle->unloaded);
    status.add("samples with a sensor overloaded", spindle->overloaded);
    status.add("smallest compression margin [N]", spindle->compression_margin);
    status.add("standard deviation of the zero [N]", spindle->zero_std);
    status.addf("unbalance [g mm]", "%.3f %.3f %.3f", 1e6 * std::abs(spindle->unbalance[0]),
                1e6 * std::abs(spindle->unbalance[1]), 1e6 * std::abs(spindle->unbalance[2]));
    status.add("segments without cutting evaluated", spindle->air_segments);
  }
  status.add("inputs out of order", pipeline_.sorter().late());
  status.add("waiting for", pipeline_.sorter().waitingFor());
  status.add("last measurement of the sensor", measurement_server_.lastMessage());
  status.add("last calibration step", calibration_server_.lastMessage());
}

}  // namespace smartmill::kalman

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<kalman::KalmanNode>(argc, argv, "kalman");
}
