#include "node/alignment_node.h"

#include <utility>

#include <ros/ros.h>

#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::daq {

AlignmentNode::AlignmentNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<AlignmentNodeParameters>()),
      alignment_(SignalName(parameters_.late), SignalName(parameters_.early), parameters_.alignment),
      shell_(nh, private_nh, "alignment", parameters_.input_timeout) {
  listen(alignment_.late());
  if (alignment_.early().topic != alignment_.late().topic) listen(alignment_.early());
  shell_.diagnose("alignment " + alignment_.late().text() + " to " + alignment_.early().text(),
                  [this](auto& status) { diagnose(status); });
}

void AlignmentNode::listen(const SignalName& signal) {
  if (signal.ofController()) {
    shell_.inputs().on<CncState>(signal.topic, [this](const CncState& state, double) {
      alignment_.push(state);
      announceChange();
    });
    return;
  }
  shell_.inputs().on<SampleBlock>(signal.topic,
                                  [this, topic = signal.topic](const SampleBlock& block, double) {
                                    alignment_.push(topic, block);
                                    announceChange();
                                  });
}

void AlignmentNode::announceChange() {
  if (std::string change = alignment_.takeChange(); !change.empty()) {
    change_ = std::move(change);
    ROS_WARN("%s", change_.c_str());
  }
}

void AlignmentNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const std::string change = std::exchange(change_, {});
  const bool dead = shell_.inputs().watchdog(alignment_.late().topic).dead() ||
                    shell_.inputs().watchdog(alignment_.early().topic).dead();
  const auto& state = alignment_.state();
  if (!change.empty()) {
    status.summary(Level::WARN, change);
  } else if (dead && !state) {
    status.summary(Level::STALE, "no samples");
  } else {
    status.summary(Level::OK, alignmentText(alignment_));
  }
  if (state) {
    status.add("method", methodName(state->method));
    status.add("shift [s]", state->shift.delay);
    status.add("standard deviation of the shift [s]", state->shift.std_dev);
    status.add("explained [1]", state->shift.explained);
    status.add("events", state->shift.events);
  }
  status.add("records", alignment_.records());
  status.add("records that show a shift", alignment_.shown());
}

}  // namespace smartmill::daq

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<daq::AlignmentNode>(argc, argv, "alignment");
}
