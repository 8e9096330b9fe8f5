#include "node.h"

#include <algorithm>
#include <type_traits>

#include <geometry_msgs/WrenchStamped.h>
#include <smartmill_msgs/ForceBlock.h>
#include <boost/function.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/frames.h"

namespace smartmill::kalman {
namespace {

constexpr int QUEUE = 2000;  // 20 s of blocks

void rotateInPlace(const std::array<double, 9>& rotation, ForceBlock& block) {
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    const auto turned = frames::rotate(rotation, {block.force[0][i], block.force[1][i], block.force[2][i]});
    for (std::size_t axis = 0; axis < 3; ++axis) block.force[axis][i] = turned[axis];
  }
}

}  // namespace

KalmanNode::KalmanNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_([&] {
        ParameterReader reader = ParameterReader::fromServer(private_nh);
        return readParameters(reader);
      }()),
      sorted_([&] {
        const MachineModel model = readMachineModel(parameters_.model);
        SortedCompensation sorted(parameters_.compensation, model.force_sensor.measures_workpiece,
                                  parameters_.hold_back,
                                  [this](const ForceBlock& m, const ForceBlock& c) { publish(m, c); });
        for (std::size_t axis = 0; axis < 3; ++axis) {
          sorted.compensation().setSensor(axis, model.force_sensor.axis[axis]);
        }
        return sorted;
      }()),
      listener_(transforms_),
      diagnostics_(ros::NodeHandle(), private_nh) {
  measured_ = nh.advertise<smartmill_msgs::ForceBlock>("force/measured", QUEUE);
  compensated_ = nh.advertise<smartmill_msgs::ForceBlock>("force/compensated", QUEUE);
  wrench_ = nh.advertise<geometry_msgs::WrenchStamped>("force/wrench", QUEUE);
  const auto subscribe = [&](const char* topic, auto example) {
    using Message = decltype(example);
    const boost::function<void(const Message&)> callback = [this](const Message& m) { input(m); };
    subscribers_.push_back(nh.subscribe<Message>(topic, QUEUE, callback, ros::VoidConstPtr(),
                                                 ros::TransportHints().tcpNoDelay()));
  };
  subscribe("daq/dynamometer", smartmill_msgs::SampleBlock());
  subscribe("spindle/angle", smartmill_msgs::SpindleAngle());
  subscribe("cut/condition", smartmill_msgs::CuttingCondition());
  diagnostics_.setHardwareID("force sensor");
  diagnostics_.add("force compensation", this, &KalmanNode::diagnose);
  last_block_ = ros::WallTime::now();
  timer_ = nh.createWallTimer(ros::WallDuration(0.2), [this](const ros::WallTimerEvent&) { watch(); });
}

template <typename Message>
void KalmanNode::input(const Message& message) {
  try {
    if constexpr (std::is_same_v<Message, smartmill_msgs::SampleBlock>) {
      block(message);
    } else {
      sorted_.push(fromMsg(message));
    }
  } catch (const Error& error) {
    ROS_ERROR_THROTTLE(5.0, "%s", error.what());
  }
}

void KalmanNode::block(const smartmill_msgs::SampleBlock& message) {
  last_block_ = ros::WallTime::now();
  flushed_ = false;
  const std::string frame = message.header.frame_id.empty() ? frames::DYNAMOMETER : message.header.frame_id;
  if (!rotation_known_ || frame != sensor_frame_) {
    if (!findRotation(frame)) return;
  }
  sorted_.push(fromMsg(message));
}

// The sensor is bolted to its table: its rotation is asked for once, at the first block.
bool KalmanNode::findRotation(const std::string& frame) {
  try {
    const auto transform = transforms_.lookupTransform(frames::MACHINE, frame, ros::Time(0));
    rotation_ = frames::rotationMatrix(transform.transform.rotation);
  } catch (const tf2::TransformException& e) {
    ROS_WARN_THROTTLE(5.0, "no transform from %s to %s yet, force blocks wait: %s", frame.c_str(),
                      frames::MACHINE, e.what());
    return false;
  }
  sensor_frame_ = frame;
  rotation_known_ = true;
  return true;
}

void KalmanNode::publish(ForceBlock measured, ForceBlock compensated) {
  rotateInPlace(rotation_, measured);
  rotateInPlace(rotation_, compensated);
  measured_.publish(toMsg(measured, frames::MACHINE));
  compensated_.publish(toMsg(compensated, frames::MACHINE));
  publishWrench(compensated);
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
  // End of data: nothing more will come to release what waits.
  if (!flushed_ && (ros::WallTime::now() - last_block_).toSec() > parameters_.input_timeout) {
    sorted_.flush();
    flushed_ = true;
  }
  diagnostics_.update();
}

void KalmanNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const CompensationHealth& health = sorted_.compensation().health();
  const double silent = (ros::WallTime::now() - last_block_).toSec();
  if (silent > parameters_.input_timeout) {
    status.summary(diagnostic_msgs::DiagnosticStatus::STALE, "no samples from the force sensor");
  } else if (!rotation_known_) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, "no transform of the force sensor");
  } else if (health.gaps + health.not_finite + health.clipped > 0) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "samples were lost, clipped or not numbers");
  } else if (health.innovation_ratio > 3.0) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN,
                   "innovations larger than the sensor model explains");
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK,
                   health.speed > 0.0 ? "compensating" : "passing through");
  }
  status.add("spindle speed of the filters [rad/s]", health.speed);
  status.add("innovation over design [1]", health.innovation_ratio);
  status.add("gaps", health.gaps);
  status.add("samples not numbers", health.not_finite);
  status.add("samples clipped", health.clipped);
  status.add("inputs out of order", sorted_.late());
  status.add("waiting for", sorted_.waitingFor());
}

}  // namespace smartmill::kalman
