#include "node/sound_node.h"

#include <cmath>

#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SoundAdvice.h>
#include <smartmill_msgs/SoundFeatures.h>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/is_ready.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::stability {
namespace {

constexpr double WORK_PERIOD = 0.05, ADVICE_PERIOD = 0.2;  // [s]

using smartmill_msgs::SoundAdvice;
using smartmill_msgs::SoundTry;

static_assert(SoundAdvice::IDLE == static_cast<int>(SoundState::Kind::idle) &&
              SoundAdvice::CUTTING == static_cast<int>(SoundState::Kind::cutting));
static_assert(SoundTry::STABLE == static_cast<int>(RecordingVerdict::Kind::stable) &&
              SoundTry::CHATTER == static_cast<int>(RecordingVerdict::Kind::chatter) &&
              SoundTry::UNSURE == static_cast<int>(RecordingVerdict::Kind::unsure));

SoundTry messageOf(const stability::SoundTry& heard, bool used) {
  SoundTry message;
  message.begin = fromSec(heard.begin);
  message.end = fromSec(heard.end);
  message.kind = static_cast<std::uint8_t>(heard.kind);
  message.spindle_speed = heard.speed;
  message.probability = heard.probability;
  message.frequency = heard.frequency;
  message.clipped = heard.clipped;
  message.used = used;
  message.text = heard.text;
  return message;
}

CutSetting settingOf(const smartmill_msgs::SetSoundCut::Request& request) {
  CutSetting setting;
  if (request.teeth > 0) setting.teeth = static_cast<int>(std::min(request.teeth, 1000u));
  if (std::isnan(request.speed_low) != std::isnan(request.speed_high))
    throw Error("speed_low, speed_high: expected both, or both NaN");
  if (!std::isnan(request.speed_low)) setting.range = SpeedRange{request.speed_low, request.speed_high};
  if (!std::isnan(request.spindle_speed)) setting.speed = request.spindle_speed;
  setting.restart = request.restart;
  setting.discard_last = request.discard_last;
  return setting;
}

}  // namespace

SoundNode::SoundNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<SoundNodeParameters>()),
      shell_(nh, private_nh, "none", parameters_.input_timeout),
      listener_(parameters_.sound),
      advice_(nh.advertise<smartmill_msgs::SoundAdvice>(names::SOUND_ADVICE, 10, true)),
      features_(nh.advertise<smartmill_msgs::SoundFeatures>(names::SOUND_FEATURES, STREAM_QUEUE)),
      set_cut_(nh.advertiseService(names::SET_SOUND_CUT, &SoundNode::setCut, this)) {
  shell_.inputs().on<SampleBlock>(parameters_.input, [this](const SampleBlock& block, double) {
    listener_.push(block);
    publishFeatures();
  });
  shell_.inputs().on<CncState>(names::CNC_STATE,
                               [this](const CncState& state, double) { listener_.push(state); });
  shell_.diagnose("sound", [this](auto& status) { diagnose(status); });
  shell_.every(WORK_PERIOD, [this] { work(); });
  shell_.every(ADVICE_PERIOD, [this] { publishAdvice(); });
}

void SoundNode::work() {
  if (shell_.inputs().watchdog(parameters_.input).dead())
    listener_.stop(
        formatted("%s: no samples for %g s", parameters_.input.c_str(), parameters_.input_timeout));
  if (isReady(outcome_)) listener_.finish(outcome_.get());
  if (!outcome_.valid())
    if (auto job = listener_.nextJob())
      outcome_ = std::async(std::launch::async, [job = std::move(*job)] { return job.run(); });
  for (const std::string& line : listener_.takeLines()) ROS_INFO("%s", line.c_str());
}

void SoundNode::publishFeatures() {
  for (const SoundFeatures& features : listener_.takeFeatures()) {
    smartmill_msgs::SoundFeatures message;
    message.header.stamp = fromSec(features.stamp);
    message.duration = features.duration;
    message.unit = listener_.state().unit;
    message.level = features.level;
    message.clipped = features.clipped;
    message.lowest = features.lowest;
    message.step = features.step;
    message.amplitude = features.amplitude;
    features_.publish(message);
  }
}

void SoundNode::publishAdvice() {
  const SoundState& state = listener_.state();
  SoundAdvice message;
  message.header.stamp = fromSec(state.stamp);
  message.state = static_cast<std::uint8_t>(state.kind);
  message.level = state.level;
  message.quiet_level = state.quiet_level;
  message.unit = state.unit;
  message.clipped = state.clipped;
  message.teeth = static_cast<std::uint32_t>(state.teeth);
  message.spindle_speed = state.speed;
  message.speed_low = state.range.low;
  message.speed_high = state.range.high;
  for (std::size_t k = 0; k < state.tries.size(); ++k)
    message.tries.push_back(messageOf(state.tries[k], state.advice.used[k]));
  message.running = state.running;
  for (const SpeedProposal& proposal : state.advice.speeds) {
    message.next_speed.push_back(proposal.speed);
    message.next_stable.push_back(proposal.stable);
  }
  message.text = state.text;
  advice_.publish(message);
}

bool SoundNode::setCut(smartmill_msgs::SetSoundCut::Request& request,
                       smartmill_msgs::SetSoundCut::Response& response) {
  try {
    listener_.set(settingOf(request));
    const SoundState& state = listener_.state();
    response.message =
        formatted("%d teeth, next cut at %.0f rpm", state.teeth, units::rpmFromRadPerSec(state.speed));
    if (state.speed == 0.0) response.message = formatted("%d teeth, speed from the harmonics", state.teeth);
    if (request.restart) response.message += ", tries forgotten";
    publishAdvice();
  } catch (const Error& error) {
    response.code = smartmill_msgs::SetSoundCut::Response::BAD_REQUEST;
    response.message = error.what();
  }
  return true;
}

void SoundNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  constexpr double MOST_CLIPPED = 0.001;  // [1]
  const SoundState& state = listener_.state();
  if (state.kind == SoundState::Kind::no_sound) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR,
                   state.silence.empty() ? "no sound yet" : state.silence);
  } else if (state.clipped > MOST_CLIPPED) {
    status.summaryf(diagnostic_msgs::DiagnosticStatus::WARN,
                    "%.1f %% of the samples are clipped: reduce the gain", 100.0 * state.clipped);
  } else if (state.teeth == 0) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "the number of teeth is not set");
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK,
                   state.kind == SoundState::Kind::cutting ? "cutting" : "listening");
  }
  status.add("level [" + state.unit + "]", state.level);
  status.add("samples clipped [1]", state.clipped);
  status.add("tries", state.tries.size());
}

}  // namespace smartmill::stability

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<stability::SoundNode>(argc, argv, "sound");
}
