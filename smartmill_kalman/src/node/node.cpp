#include "node/node.h"

#include <algorithm>
#include <cmath>

#include <geometry_msgs/WrenchStamped.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <boost/function.hpp>

#include "node/rotation.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/frames.h"

namespace smartmill::kalman {
namespace {

constexpr std::size_t QUEUE = 2000;  // 20 s of blocks
constexpr double COLOURED = 0.5;     // [1] correlation of neighbouring innovations

}  // namespace

KalmanNode::KalmanNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_([&] {
        ParameterReader reader = ParameterReader::fromServer(private_nh);
        return readParameters(reader);
      }()),
      listener_(transforms_),
      sorted_(parameters_.compensation, parameters_.taps,
              [this] {
                if (parameters_.model.empty())
                  throw Error("model: the path of a smartmill-model/1 file is due");
                return readMachineModel(parameters_.model).force_sensor;
              }(),
              parameters_.hold_back,
              {[this](const ForceBlock& m, const ForceBlock& c) { publish(m, c); },
               [this](const StrikeCommand& command) { measure_.strike(command); },
               [this](const TapFeedback& feedback) { measure_.feedback(feedback); },
               [this](const SensorResult& result) { measure_.finish(result); }}),
      measure_(nh, sorted_, parameters_.command_machine),
      diagnostics_(ros::NodeHandle(), private_nh) {
  if (!parameters_.sensor_matrix.empty()) sorted_.useMatrix(readSensorMatrix(parameters_.sensor_matrix));
  if (!parameters_.spindle_sensor.empty()) {
    sorted_.useSpindleSensor(readSpindleSensor(parameters_.spindle_sensor),
                             parameters_.spindle_sensor_length);
  }
  measured_ = nh.advertise<smartmill_msgs::ForceBlock>("force/measured", QUEUE);
  compensated_ = nh.advertise<smartmill_msgs::ForceBlock>("force/compensated", QUEUE);
  wrench_ = nh.advertise<geometry_msgs::WrenchStamped>("force/wrench", QUEUE);
  sorted_.onRestart([this] { measure_.restart(); });
  subscribe<smartmill_msgs::SampleBlock>(
      nh, "daq/dynamometer", [this](const smartmill_msgs::SampleBlock& message) {
        last_block_ = ros::WallTime::now();
        flushed_ = false;
        const std::string frame =
            message.header.frame_id.empty() ? frames::DYNAMOMETER : message.header.frame_id;
        if (frame != sensor_frame_) rotation_known_ = false;
        sensor_frame_ = frame;
        sorted_.push(fromMsg(message));
      });
  subscribe<smartmill_msgs::SampleBlock>(nh, "daq/hammer",
                                         [this](const smartmill_msgs::SampleBlock& message) {
                                           last_hammer_ = ros::WallTime::now();
                                           hammer_seen_ = true;
                                           sorted_.pushHammer(fromMsg(message));
                                         });
  subscribe<smartmill_msgs::SpindleAngle>(
      nh, "spindle/angle", [this](const smartmill_msgs::SpindleAngle& m) { sorted_.push(fromMsg(m)); });
  subscribe<smartmill_msgs::CuttingCondition>(
      nh, "cut/condition", [this](const smartmill_msgs::CuttingCondition& m) { sorted_.push(fromMsg(m)); });
  // A recording that began after the taps holds the modes that served in it.
  if (!parameters_.command_machine) {
    subscribe<smartmill_msgs::ModalModel>(
        nh, "tool/modes", [this](const smartmill_msgs::ModalModel& m) { sorted_.push(fromMsg(m)); });
  }
  diagnostics_.setHardwareID("force sensor");
  diagnostics_.add("force compensation", this, &KalmanNode::diagnose);
  last_block_ = last_hammer_ = ros::WallTime::now();
  timer_ = nh.createWallTimer(ros::WallDuration(0.05), [this](const ros::WallTimerEvent&) { watch(); });
  diagnostics_timer_ = nh.createWallTimer(ros::WallDuration(0.5),
                                          [this](const ros::WallTimerEvent&) { diagnostics_.update(); });
}

template <typename Message, typename Handle>
void KalmanNode::subscribe(ros::NodeHandle& nh, const char* topic, Handle handle) {
  const boost::function<void(const Message&)> callback = [handle, topic](const Message& message) {
    try {
      handle(message);
    } catch (const Error& error) {
      ROS_ERROR_THROTTLE(5.0, "kalman: %s: %s", topic, error.what());
    }
  };
  subscribers_.push_back(
      nh.subscribe<Message>(topic, QUEUE, callback, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay()));
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
  if (waiting_.size() > QUEUE) waiting_.pop_front();
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
  const ros::WallTime now = ros::WallTime::now();
  const double silent = (now - last_block_).toSec(), hammer_silent = (now - last_hammer_).toSec();
  const bool sensor_dead = silent > parameters_.input_timeout;
  const bool hammer_dead = hammer_silent > parameters_.input_timeout;
  std::string dead;
  if (sensor_dead) dead = "daq/dynamometer is silent";
  if (hammer_dead) dead = "daq/hammer is silent";
  if (hammer_dead && hammer_seen_) {
    hammer_seen_ = false;
    sorted_.hammerLost(dead);
  } else if (!dead.empty() && parameters_.command_machine && sorted_.measuring()) {
    sorted_.event([dead](SensorMeasurement& m) { m.lost(dead); });
    sorted_.flush();
  }
  measure_.poll(parameters_.command_machine ? dead : "");
  publishWaiting();
  // End of data: nothing more will come to release what waits.
  if (!flushed_ && sensor_dead) {
    sorted_.flush();
    flushed_ = true;
  }
}

void KalmanNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const CompensationHealth& health = sorted_.health();
  const double silent = (ros::WallTime::now() - last_block_).toSec();
  const SpindleSensorHealth* spindle = sorted_.spindleHealth();
  const std::size_t invalid = spindle ? spindle->unloaded + spindle->overloaded : 0;
  // Told once, whatever came after.
  if (spindle && invalid != invalid_told_) {
    invalid_told_ = invalid;
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR,
                   "a sensor of the spindle was unloaded or overloaded: those samples are no measurement");
  } else if (silent > parameters_.input_timeout) {
    status.summary(diagnostic_msgs::DiagnosticStatus::STALE, "no samples from the force sensor");
  } else if (!rotation_known_) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, "no transform of the force sensor");
  } else if (health.gaps + health.not_finite + health.clipped > 0) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "samples were lost, clipped or not numbers");
  } else if (health.innovation_ratio > 3.0) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN,
                   "innovations larger than the sensor model explains");
  } else if (health.speed > 0.0 && health.colour > COLOURED) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN,
                   "innovations are not white: something of the force or of the sensor is not in the model");
  } else if (parameters_.drift_limit > 0.0 &&
             std::max({std::abs(health.zero[0]), std::abs(health.zero[1]), std::abs(health.zero[2])}) >
                 parameters_.drift_limit) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "the sensor's zero has drifted");
  } else if (parameters_.model_max_age > 0.0 && sorted_.modesAge() > parameters_.model_max_age) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN,
                   "the taps in use are old: measure the sensor again");
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, sorted_.measuring()  ? "measuring the sensor"
                                                          : health.speed > 0.0 ? "compensating"
                                                                               : "passing through");
  }
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
}

}  // namespace smartmill::kalman
