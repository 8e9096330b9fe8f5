#include "node/control_node.h"

#include <cmath>

#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <boost/function.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill::stability {
namespace {

constexpr int QUEUE = 2000;

ControlStreamParameters readControl(ros::NodeHandle private_nh) {
  ParameterReader reader = ParameterReader::fromServer(private_nh);
  ControlStreamParameters p;
  reader.read("deflection_channel", p.deflection_channel);
  reader.read("tool_channel", p.tool_channel);
  reader.read("integrator_corner", p.integrator_corner);
  reader.read("speed_tolerance", p.speed_tolerance);
  reader.read("overlap", p.controller.overlap);
  reader.read("chip", p.controller.chip);
  reader.read("drift", p.controller.drift);
  reader.read("margin", p.controller.margin);
  reader.read("estimator_rate", p.controller.estimator.sample_rate);
  reader.read("segment", p.controller.estimator.segment);
  reader.read("block", p.controller.estimator.block);
  reader.read("least_signal", p.controller.estimator.least_signal);
  reader.read("frequency_low", p.controller.estimator.frequency_low);
  reader.read("frequency_high", p.controller.estimator.frequency_high);
  reader.finish();
  return p;
}

}  // namespace

ControlNode::ControlNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : stream_(readControl(private_nh), [this](const LearntMachine& learnt) { publish(learnt); }),
      diagnostics_(ros::NodeHandle(), private_nh) {
  command_ = nh.advertise<smartmill_msgs::SampleBlock>("control/command", QUEUE);
  machine_ = nh.advertise<smartmill_msgs::ModalModel>("control/machine", 10, true);
  const boost::function<void(const smartmill_msgs::SpindleAngle&)> on_angle =
      [this](const smartmill_msgs::SpindleAngle& message) { stream_.handle(fromMsg(message)); };
  angle_ = nh.subscribe<smartmill_msgs::SpindleAngle>("spindle/angle", QUEUE, on_angle, ros::VoidConstPtr(),
                                                      ros::TransportHints().tcpNoDelay());
  const boost::function<void(const smartmill_msgs::SampleBlock&)> on_block =
      [this](const smartmill_msgs::SampleBlock& message) {
        try {
          const auto commands = stream_.handle(fromMsg(message));
          problem_.clear();
          if (commands) command_.publish(toMsg(*commands));
        } catch (const Error& error) {
          problem_ = error.what();
          ROS_ERROR_THROTTLE(5.0, "%s", error.what());
        }
      };
  displacement_ = nh.subscribe<smartmill_msgs::SampleBlock>(
      "daq/displacement", QUEUE, on_block, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
  diagnostics_.setHardwareID("none");
  diagnostics_.add("chatter control", [this](diagnostic_updater::DiagnosticStatusWrapper& status) {
    using Level = diagnostic_msgs::DiagnosticStatus;
    if (!problem_.empty()) {
      status.summary(Level::ERROR, problem_);
    } else {
      status.summary(Level::OK, last_.controller.gain > 0.0 ? "controlling" : "learning");
    }
    status.add("natural frequency [rad/s]", last_.machine.frequency);
    status.add("damping ratio [1]", last_.machine.damping_ratio);
    status.add("cutting over machine stiffness [1]", last_.machine.gain);
  });
  timer_ = nh.createWallTimer(ros::WallDuration(0.5),
                              [this](const ros::WallTimerEvent&) { diagnostics_.update(); });
}

void ControlNode::publish(const LearntMachine& learnt) {
  last_ = learnt;
  if (!(learnt.machine.gain > 0.0)) return;
  const SecondOrder& m = learnt.machine;
  MeasuredModes modes;
  modes.stamp = learnt.stamp;
  modes.point = "turning_tool";
  modes.direction = "x";
  modes.unit = "1";  // deflection over chip thickness: static gain K / K_m
  Mode mode{m.frequency / units::TWO_PI, m.damping_ratio, m.gain};
  mode.gain_std = std::sqrt(m.covariance(0, 0));
  mode.frequency_std = std::sqrt(m.covariance(1, 1)) / units::TWO_PI;
  mode.damping_ratio_std = std::sqrt(m.covariance(2, 2));
  modes.model.modes = {mode};
  machine_.publish(toMsg(modes));
}

}  // namespace smartmill::stability
