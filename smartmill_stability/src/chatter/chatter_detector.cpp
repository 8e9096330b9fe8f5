#include "smartmill_stability/chatter/chatter_detector.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_core/require.h"
#include "smartmill_core/signal/interpolate.h"
#include "smartmill_core/signal/revolution_window.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chatter/recording.h"

namespace smartmill::stability {
namespace {

bool isUnsteady(const CuttingCondition& condition) {
  return condition.kind == CuttingCondition::Kind::unsteady;
}

/// Thin chips alternate by runout as much as those of a flip.
ChatterCriterionOptions withoutFlips(ChatterCriterionOptions options) {
  options.alternation_ratio = 1.0;
  return options;
}

}  // namespace

void ChatterParameters::validate() const {
  checkBounds(*this);
  require(hop_revolutions <= revolutions, "chatter_hop_revolutions", hop_revolutions,
          "at most chatter_revolutions");
}

ChatterCriterionOptions ChatterParameters::criterion() const {
  ChatterCriterionOptions options;
  options.energy_ratio = energy_ratio;
  options.least_severity = least_severity;
  options.alternation_ratio = alternation_ratio;
  return options;
}

ChatterDetector::ChatterDetector(const ChatterParameters& parameters, Output output)
    : parameters_(parameters),
      criterion_(parameters.criterion()),
      unsteady_criterion_(withoutFlips(parameters.criterion())),
      output_(std::move(output)) {
  parameters_.validate();
}

void ChatterDetector::reset() {
  condition_.reset();
  samples_.clear();
  angles_.clear();
  positions_.clear();
  dropWindow();
  last_state_ = 0.0;
  next_index_ = 0;
  reported_invalid_ = false;
}

void ChatterDetector::dropWindow() {
  steady_since_.reset();
  steady_until_.reset();
  window_start_.reset();
  harmonics_from_.reset();
}

void ChatterDetector::notSteady(double stamp) {
  dropWindow();
  // The first condition may be older than its receipt: the results must not depend on how late it was
  // received.
  if (reported_invalid_ || !condition_) return;
  reported_invalid_ = true;
  ChatterState state;
  state.stamp = stamp;
  state.condition = condition_->name;
  output_(state);
}

void ChatterDetector::handle(const CuttingCondition& condition) {
  condition_ = condition;
  reported_invalid_ = false;
  positions_.clear();
  // The angle is accumulated from here on, so that rounding does not depend on how long the node has run.
  if (!angles_.empty())
    angles_.assign(1, {angles_.back().time, angles_.back().measured, angles_.back().measured});
  notSteady(condition.stamp);
}

bool ChatterDetector::isJudged(const CncState& state) const {
  if (!condition_ || !state.connected || !(state.feed > 0.0)) return false;
  if (isUnsteady(*condition_))
    return parameters_.angle == "measured" && condition_->tool.teeth >= 2 && condition_->tool.pitch.empty();
  return condition_->kind == CuttingCondition::Kind::cut &&
         inSteadyCut(*condition_, state, parameters_.path_tolerance);
}

void ChatterDetector::handle(const CncState& state) {
  const bool gap = state.stamp - last_state_ > parameters_.maximum_gap;
  last_state_ = state.stamp;
  speed_ = state.spindle_speed;
  const bool judged = isJudged(state);
  if (!judged || gap) notSteady(state.stamp);
  if (!judged) return;
  if (!steady_since_) steady_since_ = state.stamp;
  steady_until_ = state.stamp;
  if (feedTurns(*condition_)) notePosition(state);
  evaluate();
}

void ChatterDetector::notePosition(const CncState& state) {
  constexpr std::size_t MOST = 1000;
  const auto x = controllerAxis(state.axes, 0), y = controllerAxis(state.axes, 1);
  if (!x || !y || std::max(*x, *y) >= state.position.size()) return;
  positions_.push_back({state.stamp, state.position[*x], state.position[*y]});
  if (positions_.size() > MOST) positions_.pop_front();
}

/// [rad/s] at which the feed turns, counterclockwise, by least squares over the directions from state to
/// state; empty: fewer than three.
std::optional<double> ChatterDetector::turnRate(double from, double to) const {
  constexpr double LEAST_WAY = 2e-5;  // [m] ten increments of a noisy position
  constexpr double AROUND = 0.03;     // [s] one state before and after
  std::vector<double> times, directions;
  const Position* last = nullptr;
  for (const Position& here : positions_) {
    if (here.time < from - AROUND || here.time > to + AROUND) continue;
    if (!last) last = &here;
    if (std::hypot(here.x - last->x, here.y - last->y) < LEAST_WAY) continue;
    double direction = std::atan2(here.y - last->y, here.x - last->x);
    if (!directions.empty())
      direction = directions.back() + std::remainder(direction - directions.back(), units::TWO_PI);
    times.push_back(0.5 * (here.time + last->time));
    directions.push_back(direction);
    last = &here;
  }
  if (times.size() < 3) return std::nullopt;
  const double n = static_cast<double>(times.size());
  const double time = std::accumulate(times.begin(), times.end(), 0.0) / n;
  double squares = 0.0, product = 0.0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    squares += (times[i] - time) * (times[i] - time);
    product += (times[i] - time) * directions[i];
  }
  return product / squares;
}

void ChatterDetector::handle(const SpindleAngle& angle) {
  if (!std::isfinite(angle.angle) || !std::isfinite(angle.speed)) return;
  if (!angles_.empty() && angle.stamp - angles_.back().time > parameters_.maximum_gap) {
    angles_.clear();
    dropWindow();
  }
  if (angles_.empty()) {
    angles_.push_back({angle.stamp, angle.angle, angle.angle});
    return;
  }
  if (!(angle.stamp > angles_.back().time)) return;
  angles_.push_back(angles_.back().next(angle));
  evaluate();
}

void ChatterDetector::handle(const ForceBlock& block) {
  if (block.status == ForceBlock::Status::settling ||
      (!samples_.empty() && block.first_index != next_index_)) {
    samples_.clear();
    window_start_.reset();
  }
  next_index_ = block.first_index + block.force[0].size();
  if (block.status == ForceBlock::Status::settling) return;
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    const std::array<double, 3> force{{block.force[0][i], block.force[1][i], block.force[2][i]}};
    if (!std::isfinite(force[0] + force[1] + force[2])) {
      samples_.clear();
      window_start_.reset();
      continue;
    }
    samples_.push_back({block.stamp + static_cast<double>(i) / block.sample_rate, force});
  }
  evaluate();
}

double ChatterDetector::angleAt(double time) const {
  const auto after = std::lower_bound(angles_.begin() + 1, angles_.end() - 1, time,
                                      [](const Angle& a, double t) { return a.time < t; });
  const Angle& b = *after;
  const Angle& a = *(after - 1);
  return a.turned + (time - a.time) / (b.time - a.time) * (b.turned - a.turned);
}

double ChatterDetector::timeAt(double turned) const {
  const auto after = std::lower_bound(angles_.begin() + 1, angles_.end() - 1, turned,
                                      [](const Angle& a, double t) { return a.turned < t; });
  const Angle& b = *after;
  const Angle& a = *(after - 1);
  return b.turned > a.turned ? a.time + (turned - a.turned) / (b.turned - a.turned) * (b.time - a.time)
                             : a.time;
}

void ChatterDetector::evaluate() {
  if (parameters_.angle == "none") {
    evaluateHarmonics();
    return;
  }
  if (!steady_since_) {
    // Retain data that the next controller state may declare steady.
    const double retained = 2.0 * parameters_.maximum_gap;
    while (!samples_.empty() && samples_.front().time < samples_.back().time - retained) samples_.pop_front();
    while (angles_.size() > 2 && angles_[1].time < angles_.back().time - retained) angles_.pop_front();
    return;
  }
  if (samples_.size() < 4 || angles_.size() < 2) return;
  const double first = std::max({*steady_since_, samples_[1].time, angles_.front().time});
  const double last = std::min({*steady_until_, samples_[samples_.size() - 3].time, angles_.back().time});
  if (!(last > first)) return;
  if (!window_start_) window_start_ = angleAt(first) + units::TWO_PI * parameters_.settle_revolutions;
  const double end = angleAt(last);
  while (*window_start_ + units::TWO_PI * parameters_.revolutions <= end) {
    judge(*window_start_, *window_start_ + units::TWO_PI * parameters_.revolutions);
    *window_start_ += units::TWO_PI * parameters_.hop_revolutions;
  }
  const double needed = std::min(timeAt(*window_start_), last) - 0.01;
  while (samples_.size() > 4 && samples_[2].time < needed) samples_.pop_front();
  while (angles_.size() > 2 && angles_[1].time < needed) angles_.pop_front();
}

void ChatterDetector::evaluateHarmonics() {
  const auto forgetBefore = [&](double time) {
    while (!samples_.empty() && samples_.front().time < time) samples_.pop_front();
  };
  if (samples_.size() < 4) return;
  if (!steady_since_ || !(speed_ > 0.0)) {
    forgetBefore(samples_.back().time - 2.0 * parameters_.maximum_gap);
    return;
  }
  if (!harmonics_from_)
    harmonics_from_ = std::max(*steady_since_, samples_.front().time) +
                      parameters_.settle_revolutions * units::TWO_PI / speed_;
  const double last = std::min(*steady_until_, samples_.back().time);
  forgetBefore(*harmonics_from_);
  if (last < *harmonics_from_ + parameters_.harmonics_window || samples_.size() < 4) return;
  judgeHarmonics(*harmonics_from_ + parameters_.harmonics_window,
                 static_cast<double>(samples_.size() - 1) / (samples_.back().time - samples_.front().time));
  *harmonics_from_ += 0.5 * parameters_.harmonics_window;
}

/// Judges the samples up to a time [s]. @param rate [Hz]
void ChatterDetector::judgeHarmonics(double to, double rate) {
  Recording recording;
  recording.sample_rate = rate;
  recording.same_unit = true;
  double variance = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> channel;
    for (const Sample& sample : samples_)
      if (sample.time <= to) channel.push_back(sample.force[axis]);
    const double deviation = standardDeviation(channel);
    if (!(deviation > 0.0)) continue;
    variance += deviation * deviation;
    recording.channels.push_back(std::move(channel));
  }
  ChatterState state;
  state.stamp = to;
  state.condition = condition_->name;
  RecordingRequest request;
  request.speed = speed_;
  request.teeth = std::max(1, static_cast<int>(condition_->tool.teeth));
  RecordingVerdict verdict;  // unsure
  try {
    if (!recording.channels.empty()) verdict = judgeRecording(recording, request);
  } catch (const Error&) {
    // Fewer than three revolutions or two samples in a tooth passing period decide nothing.
  }
  state.valid = verdict.kind == RecordingVerdict::Kind::stable || verdict.chatter();
  state.chatter = verdict.chatter();
  state.frequency = verdict.frequency;
  state.energy_ratio = verdict.energy_ratio;
  state.severity = std::sqrt(variance * verdict.energy_ratio);
  if (state.chatter) state.onset = to - parameters_.harmonics_window;
  reported_invalid_ = !state.valid;
  output_(state);
}

std::vector<double> ChatterDetector::forceAt(const std::vector<double>& times, std::size_t axis,
                                             double rate) const {
  std::vector<double> force;
  force.reserve(times.size());
  for (const double time : times) {
    const double position = (time - samples_.front().time) * rate;
    const auto at = static_cast<std::size_t>(
        std::clamp(std::floor(position), 1.0, static_cast<double>(samples_.size() - 3)));
    force.push_back(catmullRom(samples_[at - 1].force[axis], samples_[at].force[axis],
                               samples_[at + 1].force[axis], samples_[at + 2].force[axis],
                               position - static_cast<double>(at)));
  }
  return force;
}

void ChatterDetector::judge(double from, double to) {
  const bool turning = feedTurns(*condition_);
  const double start = timeAt(from);
  const std::optional<double> turn_rate = turning ? turnRate(start, timeAt(to)) : 0.0;
  if (!turn_rate) return;
  // Against the feed a revolution may be longer than that of the spindle.
  const auto turns = static_cast<std::size_t>(parameters_.revolutions - (turning ? 1 : 0));
  const auto timeOf = [&](double angle) {  // to the feed
    double time = timeAt(angle);
    for (int k = 0; turning && k < 3; ++k) time = timeAt(angle - *turn_rate * (time - start));
    return time;
  };
  const double stop = timeOf(from + units::TWO_PI * static_cast<double>(turns));
  const double period = (stop - start) / static_cast<double>(turns);
  const double rate =
      static_cast<double>(samples_.size() - 1) / (samples_.back().time - samples_.front().time);
  if (!(period * rate >= 8.0)) return;  // fewer samples in a revolution do not resolve harmonics
  const bool unsteady = isUnsteady(*condition_);
  const std::size_t multiple = unsteady ? static_cast<std::size_t>(condition_->tool.teeth) : 1;
  const auto bins =
      multiple * static_cast<std::size_t>(std::ceil(period * rate / static_cast<double>(multiple)));
  std::vector<double> times;
  for (std::size_t i = 0; i < bins * turns; ++i)
    times.push_back(timeOf(from + units::TWO_PI * static_cast<double>(i) / static_cast<double>(bins)));
  std::array<std::vector<double>, 3> force;
  for (std::size_t axis = 0; axis < 3; ++axis) force[axis] = forceAt(times, axis, rate);
  for (std::size_t i = 0; turning && i < times.size(); ++i) {
    const std::complex<double> in_feed =
        std::complex<double>(force[0][i], force[1][i]) * std::polar(1.0, -*turn_rate * (times[i] - start));
    force[0][i] = in_feed.real();
    force[1][i] = in_feed.imag();
  }
  using Cut = RevolutionWindow::Cut;
  RevolutionWindow window(bins, turns, condition_->tool.teeth, unsteady ? Cut::unsteady : Cut::steady);
  for (const std::vector<double>& axis : force) window.add(axis);
  const ChatterEvidence evidence = (unsteady ? unsteady_criterion_ : criterion_).judge(window, period);

  ChatterState state;
  state.stamp = stop;
  state.condition = condition_->name;
  state.valid = true;
  state.chatter = evidence.chatter;
  state.frequency = evidence.order / period;
  state.energy_ratio = evidence.energy_ratio;
  state.severity = evidence.severity;
  state.alternation = evidence.alternation;
  if (state.chatter) state.onset = times[evidence.onset * bins];
  reported_invalid_ = false;
  output_(state);
}

ForceBlock signalBlock(const SampleBlock& block) {
  if (block.channels.empty())
    throw Error("chatter detection: sample block without channels: expected at least one");
  ForceBlock signal;
  signal.stamp = block.stamp;
  signal.sample_rate = block.sample_rate;
  signal.first_index = block.first_index;
  signal.status = ForceBlock::Status::compensated;
  for (std::size_t c = 0; c < 3; ++c) {
    signal.force[c].assign(block.size(), 0.0);
    if (c >= block.channels.size()) continue;
    for (std::size_t i = 0; i < block.size(); ++i) signal.force[c][i] = block.at(i, c);
  }
  return signal;
}

DetectionPipeline::DetectionPipeline(const ChatterParameters& parameters, double hold_back,
                                     ChatterDetector::Output output)
    : detector_(parameters, std::move(output)),
      sorter_(hold_back),
      conditions_(sorter_.addLatched(names::CUTTING_CONDITION)),
      states_(sorter_.addRegular(names::CNC_STATE)),
      angles_(parameters.angle == "measured" ? std::optional(sorter_.addRegular(names::SPINDLE_ANGLE))
                                             : std::nullopt),
      blocks_(sorter_.addRegular(names::FORCE_COMPENSATED)) {
  sorter_.onRestart([this] { detector_.reset(); });
}

void DetectionPipeline::push(const CuttingCondition& condition) {
  sorter_.push(conditions_, condition.stamp, [this, condition] { detector_.handle(condition); });
}

void DetectionPipeline::push(const CncState& state) {
  sorter_.push(states_, state.stamp, [this, state] { detector_.handle(state); });
}

void DetectionPipeline::push(const SpindleAngle& angle) {
  if (!angles_) return;
  sorter_.push(*angles_, angle.stamp, [this, angle] { detector_.handle(angle); });
}

void DetectionPipeline::push(const ForceBlock& block) {
  sorter_.push(blocks_, block.stamp, [this, block] { detector_.handle(block); });
}

}  // namespace smartmill::stability
