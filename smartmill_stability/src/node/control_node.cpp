#include "node/control_node.h"

#include <cmath>

#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::stability {
namespace {

constexpr double INPUT_TIMEOUT = 1.0;  // [s]

}  // namespace

ControlNode::ControlNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : shell_(nh, private_nh, "none", INPUT_TIMEOUT),
      stream_(parametersFromServer(private_nh).readAll<ControlStreamParameters>(),
              [this](const LearntMachine& learnt) { publish(learnt); }),
      command_(nh.advertise<smartmill_msgs::SampleBlock>(names::CONTROL_COMMAND, STREAM_QUEUE)),
      machine_(nh.advertise<smartmill_msgs::ModalModel>(names::CONTROL_MACHINE, 10, true)) {
  Inputs& inputs = shell_.inputs();
  inputs.on<smartmill_msgs::SpindleAngle>(
      names::SPINDLE_ANGLE,
      [this](const smartmill_msgs::SpindleAngle& message, double) { stream_.handle(fromMsg(message)); });
  inputs.on<smartmill_msgs::SampleBlock>(names::DISPLACEMENT,
                                         [this](const smartmill_msgs::SampleBlock& message, double) {
                                           if (const auto commands = stream_.handle(fromMsg(message)))
                                             command_.publish(toMsg(*commands));
                                         });
  shell_.diagnose("chatter control", [this](auto& status) { diagnose(status); });
}

void ControlNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.summary(diagnostic_msgs::DiagnosticStatus::OK,
                 last_.controller.gain > 0.0 ? "controlling" : "identifying");
  status.add("natural frequency [rad/s]", last_.machine.frequency);
  status.add("damping ratio [1]", last_.machine.damping_ratio);
  status.add("cutting stiffness over machine stiffness [1]", last_.machine.gain);
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

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<stability::ControlNode>(argc, argv, "chatter_control");
}
