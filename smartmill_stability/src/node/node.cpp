#include "node/node.h"

#include <algorithm>
#include <cmath>

#include <smartmill_msgs/BistableChart.h>
#include <smartmill_msgs/ChatterAdvice.h>
#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/StabilityChart.h>

#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_core/is_ready.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::stability {
namespace {

constexpr double WATCH_PERIOD = 0.2;      // [s]
constexpr double OVERRIDE_PERIOD = 0.02;  // [s]

NodeParameters read(const ros::NodeHandle& private_nh) {
  NodeParameters parameters = parametersFromServer(private_nh).readAll<NodeParameters>();
  if (parameters.model.empty()) throw Error("model: empty: expected the path of a smartmill-model/1 file");
  return parameters;
}

WhatIf requestOf(const smartmill_msgs::WhatIf::Request& request) {
  constexpr std::uint32_t MOST = 1000000;
  WhatIf what_if;
  what_if.teeth = static_cast<int>(std::min(request.teeth, MOST));
  what_if.helix = request.helix;
  what_if.entry = request.entry_angle;
  what_if.exit = request.exit_angle;
  what_if.feed_per_tooth = request.feed_per_tooth;
  what_if.overhang = request.overhang;
  what_if.axial_depth = request.axial_depth;
  what_if.speeds = static_cast<int>(std::min(request.speeds, MOST));
  what_if.spread = request.spread;
  return what_if;
}

ProbingRequest requestOf(const smartmill_msgs::ChooseProbingCut::Request& request) {
  const std::size_t count = request.spindle_speed.size();
  if (request.axial_depth.size() != count || request.chatter.size() != count ||
      request.chatter_frequency.size() != count)
    throw Error("cuts so far: expected arrays of one length");
  ProbingRequest probing;
  for (std::size_t k = 0; k < count; ++k) {
    JudgedCut cut;
    cut.speed = request.spindle_speed[k];
    cut.depth = request.axial_depth[k];
    cut.chatter = request.chatter[k] != 0;
    if (cut.chatter && !std::isnan(request.chatter_frequency[k]))
      cut.frequency = Measured{request.chatter_frequency[k], 0.0};
    probing.cuts.push_back(cut);
  }
  const auto known = [](double value, double other) { return std::isnan(value) ? other : value; };
  if (!std::isnan(request.ktc)) probing.ktc = Measured{request.ktc, known(request.ktc_std, 0.0)};
  probing.kte = known(request.kte, 0.0);
  probing.entry = request.entry_angle;
  probing.exit = request.exit_angle;
  probing.speed_low = request.speed_low;
  probing.speed_high = request.speed_high;
  probing.max_depth = request.max_depth;
  probing.last = request.cuts_left == 0;
  return probing;
}

}  // namespace

StabilityNode::StabilityNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(read(private_nh)),
      shell_(nh, private_nh, "none", parameters_.input_timeout),
      maker_(parameters_.chart, readMachineModel(parameters_.model)),
      detection_(parameters_.chatter, parameters_.hold_back,
                 [this](const ChatterState& state) { handle(state); }),
      advisor_(
          parameters_.chart.speed_low, maker_.highestSpeed(), maker_.teeth(),
          [this](const CuttingCondition& condition) {
            return maker_.hasTool(condition) ? maker_.system(condition.engagement) : std::nullopt;
          },
          [this](const ChatterAdvice& advice) { publish(advice); },
          [this](const ChatterAdvice& advice) {
            control_.handle(advice);
            override();
          }),
      control_(parameters_.control, parameters_.chatter.revolutions,
               [this](const Engagement& engagement) {
                 return other_tool_.empty() ? maker_.uncertainSystem(engagement) : std::nullopt;
               }),
      chart_(nh.advertise<smartmill_msgs::StabilityChart>(names::STABILITY_CHART, 1, true)),
      chatter_(nh.advertise<smartmill_msgs::ChatterState>(names::CHATTER_STATE, STREAM_QUEUE, true)),
      advice_(nh.advertise<smartmill_msgs::ChatterAdvice>(names::CHATTER_ADVICE, 10, true)),
      bistable_(nh.advertise<smartmill_msgs::BistableChart>(names::BISTABLE_CHART, 1, true)),
      predict_(nh.advertiseService(names::PREDICT_STABILITY, &StabilityNode::predict, this)),
      overrides_(nh.serviceClient<smartmill_msgs::SetOverrides>(names::SET_OVERRIDES)) {
  ros::NodeHandle what_if_nh(nh);
  what_if_nh.setCallbackQueue(&what_if_queue_);
  what_if_ = what_if_nh.advertiseService(names::WHAT_IF, &StabilityNode::whatIf, this);
  what_if_spinner_.start();
  ros::NodeHandle probing_nh(nh);
  probing_nh.setCallbackQueue(&probing_queue_);
  probing_ = probing_nh.advertiseService(names::CHOOSE_PROBING_CUT, &StabilityNode::chooseProbingCut, this);
  probing_spinner_.start();
  if (!parameters_.force_curve.empty()) {
    curves_.emplace();
    curves_->curves = readForceCurves(parameters_.force_curve);
    curves_->teeth = maker_.teeth();
  }
  listen();
  shell_.diagnose("stability chart", [this](auto& status) { diagnoseChart(status); });
  shell_.diagnose("chatter detection", [this](auto& status) { diagnoseChatter(status); });
  shell_.every(WATCH_PERIOD, [this] { watch(); });
  if (parameters_.control.adaptive) shell_.every(OVERRIDE_PERIOD, [this] { override(); });
}

void StabilityNode::listen() {
  Inputs& inputs = shell_.inputs();
  connectMeasured(inputs, [this](const auto& measured) { handleMeasured(measured); });
  inputs.on<smartmill_msgs::CuttingCondition>(
      names::CUTTING_CONDITION, [this](const smartmill_msgs::CuttingCondition& message, double) {
        const CuttingCondition condition = fromMsg(message);
        if (condition.tool.teeth > 0) other_tool_ = maker_.hasTool(condition) ? "" : condition.tool_name;
        advisor_.handle(condition);
        detection_.push(condition);
        control_.handle(condition);
      });
  if (parameters_.control.adaptive) {
    inputs.on<smartmill_msgs::LoadSample>(
        names::CNC_LOAD,
        [this](const smartmill_msgs::LoadSample& message, double) { control_.handle(fromMsg(message)); });
  }
  connect(inputs, parameters_, streams_);
}

template <typename Measured>
void StabilityNode::handleMeasured(const Measured& measured) {
  bistable_outdated_ = true;
  if constexpr (std::is_same_v<Measured, IdentifiedForceCurves>) {
    if (parameters_.force_curve.empty()) curves_ = measured;
    return;
  } else {
    const std::lock_guard<std::mutex> lock(maker_mutex_);
    maker_.handle(measured);
  }
  chart_problem_.clear();
  if (!maker_.missing().empty()) return;
  try {
    chart_.publish(toMsg(maker_.chart()));
  } catch (const Error& error) {
    chart_problem_ = error.what();
    throw;
  }
}

void StabilityNode::handle(const ChatterState& state) {
  publish(state);
  control_.handle(state);
  try {
    if (control_.moving()) {
      advisor_.restart();
    } else {
      advisor_.handle(state);
    }
  } catch (const Error& error) {
    ROS_ERROR("chatter advice: %s", error.what());
  }
}

void StabilityNode::override() {
  for (const std::string& note : control_.takeNotes()) ROS_WARN("%s", note.c_str());
  if (answer_.valid()) {
    if (!isReady(answer_)) return;
    const smartmill_msgs::SetOverrides::Response answer = answer_.get();
    control_.answer(answer.code == smartmill_msgs::SetOverrides::Response::OK, answer.message,
                    toSec(ros::Time::now()));
  }
  const std::optional<OverrideRequest> request = control_.takeRequest();
  if (!request) return;
  ROS_WARN("%s", request->reason.c_str());
  answer_ = std::async(std::launch::async, [client = overrides_, request]() mutable {
    smartmill_msgs::SetOverrides call;
    call.request.feed = request->feed;
    call.request.spindle = request->spindle;
    call.request.reason = request->reason;
    if (!client.call(call)) {
      call.response.code = smartmill_msgs::SetOverrides::Response::NOT_CONNECTED;
      call.response.message = "no answer from " + client.getService();
    }
    return call.response;
  });
}

void StabilityNode::publish(const ChatterState& state) {
  last_state_ = state;
  smartmill_msgs::ChatterState message;
  message.header.stamp = fromSec(state.stamp);
  message.condition = state.condition;
  message.valid = state.valid;
  message.chatter = state.chatter;
  message.frequency = state.frequency;
  message.energy_ratio = state.energy_ratio;
  message.severity = state.severity;
  chatter_.publish(message);
}

void StabilityNode::publish(const ChatterAdvice& advice) {
  smartmill_msgs::ChatterAdvice message;
  message.header.stamp = fromSec(advice.stamp);
  message.condition = advice.episode.condition;
  message.frequency = advice.episode.frequency;
  message.severity = advice.episode.severity;
  message.onset = advice.episode.onset;
  for (const ChatterAdvice::Speed& s : advice.speeds) {
    message.speeds.push_back(toMsg(StabilityPoint{s.speed, advice.depth, s.limit, s.frequency}));
  }
  message.corrected = advice.correction.has_value();
  if (advice.correction) {
    const std::size_t in_x = maker_.modesInX(), mode = advice.correction->mode;
    message.direction = mode < in_x ? "x" : "y";
    message.mode = static_cast<std::uint32_t>(mode < in_x ? mode : mode - in_x);
    message.believed_frequency = advice.believed_frequency;
    message.corrected_frequency = advice.correction->frequency;
    message.believed_depth_limit = advice.believed_limit;
    message.corrected_depth_limit = advice.corrected_limit;
  }
  advice_.publish(message);
}

bool StabilityNode::predict(smartmill_msgs::PredictStability::Request& request,
                            smartmill_msgs::PredictStability::Response& response) {
  using Response = smartmill_msgs::PredictStability::Response;
  const std::string missing = maker_.missing();
  if (!missing.empty()) {
    response.code = Response::NO_CHART;
    response.message = "no chart yet, missing: " + missing;
    return true;
  }
  try {
    const Prediction prediction = maker_.predict(request.spindle_speed, request.axial_depth);
    response.code = Response::OK;
    response.stable = prediction.stable;
    response.within_spindle_limits = prediction.within_spindle_limits;
    response.point = toMsg(prediction.point);
    response.message = prediction.stable ? "stable" : "unstable";
  } catch (const Error& error) {
    response.code = Response::BAD_REQUEST;
    response.message = error.what();
  }
  return true;
}

bool StabilityNode::whatIf(smartmill_msgs::WhatIf::Request& request,
                           smartmill_msgs::WhatIf::Response& response) {
  using Response = smartmill_msgs::WhatIf::Response;
  std::unique_lock<std::mutex> lock(maker_mutex_);
  const ChartMaker maker = maker_;
  lock.unlock();
  if (!maker.system({})) {
    response.code = Response::NOT_READY;
    response.message = "expected modes of x and y and the tangential coefficient";
    return true;
  }
  try {
    const ros::SteadyTime begin = ros::SteadyTime::now();
    WhatIfChart chart = maker.whatIf(requestOf(request));
    response.code = Response::OK;
    response.spindle_speed = std::move(chart.limit.spindle_speed);
    response.depth_limit = std::move(chart.limit.depth);
    response.chatter_frequency = std::move(chart.limit.chatter_frequency);
    response.mode.assign(chart.mode.begin(), chart.mode.end());
    response.modes = std::move(chart.modes);
    response.torque_depth_limit = std::move(chart.torque_depth_limit);
    response.power_depth_limit = std::move(chart.power_depth_limit);
    response.limit_low = std::move(chart.limit_low);
    response.limit_high = std::move(chart.limit_high);
    response.stable_share = chart.stable_share;
    response.seconds = (ros::SteadyTime::now() - begin).toSec();
  } catch (const Error& error) {
    response.code = Response::BAD_REQUEST;
    response.message = error.what();
  }
  return true;
}

bool StabilityNode::chooseProbingCut(smartmill_msgs::ChooseProbingCut::Request& request,
                                     smartmill_msgs::ChooseProbingCut::Response& response) {
  using Response = smartmill_msgs::ChooseProbingCut::Response;
  std::unique_lock<std::mutex> lock(maker_mutex_);
  const ChartMaker maker = maker_;
  lock.unlock();
  response.next_speed = response.next_depth = response.next_probability = NOT_A_NUMBER;
  response.recommended_speed = response.recommended_depth = NOT_A_NUMBER;
  response.recommended_probability = response.recommended_probability_std = NOT_A_NUMBER;
  response.feed_per_tooth = maker.feedPerTooth();
  try {
    const ros::SteadyTime begin = ros::SteadyTime::now();
    const ProbingChoice choice = maker.chooseProbingCut(requestOf(request));
    response.code = Response::OK;
    if (choice.next) {
      response.next_speed = choice.next->speed;
      response.next_depth = choice.next->depth;
      response.next_probability = choice.next->stable;
    }
    if (choice.recommended) {
      response.recommended_speed = choice.recommended->speed;
      response.recommended_depth = choice.recommended->depth;
      response.recommended_probability = choice.recommended->stable;
      response.recommended_probability_std = choice.recommended->std_dev;
    }
    response.seconds = (ros::SteadyTime::now() - begin).toSec();
  } catch (const Error& error) {
    response.code = Response::BAD_REQUEST;
    response.message = error.what();
  }
  return true;
}

void StabilityNode::startBistable() {
  if (!bistable_outdated_ || bistable_chart_.valid() || !curves_ || !maker_.system({})) return;
  bistable_outdated_ = false;
  bistable_chart_ = std::async(std::launch::async, [maker = maker_, chart = parameters_.chart,
                                                    curves = *curves_, speeds = parameters_.bistable_speeds] {
    return bistableChart(maker, chart, curves, speeds);
  });
}

void StabilityNode::publishBistable() {
  if (!isReady(bistable_chart_)) return;
  bistable_problem_.clear();
  try {
    const std::optional<BistableChart> chart = bistable_chart_.get();
    if (!chart) return;
    smartmill_msgs::BistableChart message;
    message.header.stamp = fromSec(chart->stamp);
    message.tool = chart->tool;
    message.material = chart->material;
    message.entry_angle = chart->entry;
    message.exit_angle = chart->exit;
    message.feed_per_tooth = chart->feed;
    message.mean_chip = chart->mean_chip;
    message.tangential_slope = chart->slope;
    for (const BistableLimit& limit : chart->limits) {
      message.spindle_speed.push_back(limit.speed);
      message.small_depth_limit.push_back(limit.small.depth);
      message.large_depth_limit.push_back(limit.large.depth);
      message.secant_depth_limit.push_back(limit.secant.depth);
    }
    bistable_.publish(message);
  } catch (const Error& error) {
    bistable_problem_ = error.what();
    ROS_ERROR("limits for the force curve: %s", error.what());
  }
}

void StabilityNode::watch() {
  publishBistable();
  startBistable();
  // At the end of the data no further input releases the events held back.
  if (shell_.inputs().any().ended()) detection_.flush();
}

void StabilityNode::diagnoseChart(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::string missing = maker_.missing();
  if (!missing.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "waiting for " + missing);
  } else if (!chart_problem_.empty()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, chart_problem_);
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "chart published, by " + maker_.solver());
  }
  if (!other_tool_.empty())
    status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN,
                        "the tool in use, '" + other_tool_ + "', is not that of the chart");
  if (!bistable_problem_.empty()) status.add("limits for the force curve", bistable_problem_);
}

void StabilityNode::diagnoseChatter(diagnostic_updater::DiagnosticStatusWrapper& status) {
  if (shell_.inputs().any().dead()) {
    status.summary(diagnostic_msgs::DiagnosticStatus::STALE, "no input");
  } else if (last_state_.chatter) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "chatter in " + last_state_.condition);
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, last_state_.valid ? "no chatter" : "no judged cut");
  }
  status.add("energy ratio [1]", last_state_.energy_ratio);
  status.add("severity [N]", last_state_.severity);
  status.add("frequency [Hz]", last_state_.frequency);
  status.add("inputs out of order", detection_.late());
  status.add("waiting for", detection_.waitingFor());
}

}  // namespace smartmill::stability

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<stability::StabilityNode>(argc, argv, "stability");
}
