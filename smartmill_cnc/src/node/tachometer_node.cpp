#include "node/tachometer_node.h"

#include <utility>

#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::cnc {
namespace {

constexpr double CHECK_PERIOD = 0.2;  // [s]

}  // namespace

TachometerNode::TachometerNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<TachometerNodeParameters>()),
      tachometer_(parameters_.tachometer),
      shell_(nh, private_nh, "tachometer", parameters_.input_timeout),
      angle_(nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, STREAM_QUEUE)) {
  shell_.inputs().on<SampleBlock>(parameters_.input,
                                  [this](const SampleBlock& block, double) { handle(block); });
  shell_.inputs().on<CncState>(names::CNC_STATE, [this](const CncState& state, double) {
    tachometer_.setControllerSpeed(state.connected ? state.spindle_speed : NOT_A_NUMBER);
  });
  shell_.diagnose("pulse tachometer", [this](auto& status) { diagnose(status); });
  shell_.every(CHECK_PERIOD, [this] {
    if (shell_.inputs().watchdog(names::CNC_STATE).dead()) tachometer_.setControllerSpeed(NOT_A_NUMBER);
  });
}

void TachometerNode::handle(const SampleBlock& block) {
  for (const PulseReading& reading : tachometer_.push(block)) {
    last_ = reading;
    angle_.publish(toMsg(reading.angle));
  }
  if (std::string fault = tachometer_.takeFault(); !fault.empty()) {
    fault_ = parameters_.input + ": " + fault;
    ROS_WARN_STREAM_THROTTLE(5.0, fault_);
  }
}

void TachometerNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const PulseTachometer::Counts& counts = tachometer_.counts();
  const std::string fault = std::exchange(fault_, {});
  using State = PulseTachometer::State;
  if (shell_.inputs().watchdog(parameters_.input).dead()) {
    status.summary(Level::STALE, "no samples on " + parameters_.input + ": spindle/angle has stopped");
  } else if (tachometer_.state() == State::no_pulses) {
    status.summary(Level::ERROR, parameters_.input +
                                     ": no pulses while the controller reports a turning "
                                     "spindle: spindle/angle has stopped");
  } else if (!fault.empty()) {
    status.summary(Level::WARN, fault);
  } else if (tachometer_.state() == State::waiting) {
    status.summary(Level::WARN, parameters_.input + ": waiting for regular pulses");
  } else if (tachometer_.state() == State::at_rest && shell_.inputs().watchdog(names::CNC_STATE).dead()) {
    status.summary(Level::WARN, "no pulses: at rest or a stuck channel (no cnc/state to distinguish them)");
  } else {
    status.summary(Level::OK, tachometer_.state() == State::turning ? "turning" : "at rest");
  }
  status.add("speed [rad/s]", last_.angle.speed);
  status.add("standard deviation of the speed [rad/s]", last_.speed_std);
  status.add("standard deviation of the angle [rad]", last_.angle_std);
  status.add("pulses of the fit", tachometer_.window());
  status.add("pulses", counts.pulses);
  status.add("pulses missing", counts.missing);
  status.add("pulses double", counts.doubled);
  status.add("pulses irregular", counts.irregular);
  status.add("gaps", counts.gaps);
  status.add("samples not finite", counts.not_finite);
}

}  // namespace smartmill::cnc

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<cnc::TachometerNode>(argc, argv, "tachometer");
}
