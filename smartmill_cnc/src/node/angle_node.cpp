#include "node/angle_node.h"

#include <utility>

#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/formatted.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::cnc {
namespace {

constexpr double CHECK_PERIOD = 0.2;  // [s]

}  // namespace

AngleNode::AngleNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<AngleNodeParameters>()),
      sources_(parameters_.sources),
      shell_(nh, private_nh, "angle", parameters_.input_timeout),
      angle_(nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, STREAM_QUEUE)) {
  listen(parameters_.encoder_input, &AngleSources::pushEncoder);
  listen(parameters_.pulses_input, &AngleSources::pushPulses);
  listen(parameters_.force_input, &AngleSources::pushForces);
  if (!parameters_.controller_input.empty()) {
    shell_.inputs().on<SpindleAngle>(parameters_.controller_input, [this](const SpindleAngle& angle, double) {
      publish(sources_.pushController(angle));
    });
  }
  shell_.inputs().on<CncState>(names::CNC_STATE,
                               [this](const CncState& state, double) { publish(sources_.push(state)); });
  shell_.inputs().on<CuttingCondition>(
      names::CUTTING_CONDITION,
      [this](const CuttingCondition& condition, double) { sources_.push(condition); });
  shell_.diagnose("spindle angle", [this](auto& status) { diagnose(status); });
  shell_.every(CHECK_PERIOD, [this] {
    if (shell_.inputs().watchdog(names::CNC_STATE).dead()) sources_.forgetControllerSpeed();
  });
}

void AngleNode::listen(const std::string& topic,
                       AngleSources::Angles (AngleSources::*push)(const SampleBlock&)) {
  if (topic.empty()) return;
  shell_.inputs().on<SampleBlock>(
      topic, [this, push](const SampleBlock& block, double) { publish((sources_.*push)(block)); });
}

void AngleNode::publish(const AngleSources::Angles& angles) {
  for (const SpindleAngle& angle : angles) angle_.publish(toMsg(angle));
  if (std::string news = sources_.takeNews(); !news.empty()) {
    news_ = std::move(news);
    ROS_WARN("spindle angle: %s", news_.c_str());
  }
}

void AngleNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const AngleSelector& selector = sources_.selector();
  const auto active = selector.active();
  const std::string news = std::exchange(news_, {});
  if (!active) {
    status.summary(Level::STALE, "no source has given a reading");
  } else if (!selector.state(*active).working) {
    status.summary(Level::ERROR, "no source works: spindle/angle has stopped");
  } else if (!selector.related()) {
    status.summary(Level::WARN, "by " + selector.source(*active).name + ", up to a constant");
  } else {
    status.summary(news.empty() ? Level::OK : Level::WARN,
                   news.empty() ? "by " + selector.source(*active).name : news);
  }
  status.add("speed [rad/s]", selector.published().speed);
  for (std::size_t s = 0; s < selector.size(); ++s) {
    const AngleSelector::State state = selector.state(s);
    const std::string& name = selector.source(s).name;
    status.add(name, state.working ? (active == s ? "used" : "works") : "no readings");
    status.add("standard deviation of the angle by " + name + " [rad]",
               sources_.angleStd(static_cast<AngleSources::Source>(s)));
    if (state.offset_known)
      status.addf("offset of " + name + " [rad]", "%.4f (sd %.4f)", state.offset, state.offset_std);
  }
}

}  // namespace smartmill::cnc

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<cnc::AngleNode>(argc, argv, "angle");
}
