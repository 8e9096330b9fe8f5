#include "smartmill_daq/alignment/stream_alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/derivative.h"
#include "smartmill_daq/clock/sample_clock.h"

namespace smartmill::daq {
namespace {

constexpr double MOTION_RATE = 10.0;  // [1] common samples per state of the controller
// A record contradicts those before it beyond both: the line of a counted clock wanders by less than what
// counts as a jump of it.
constexpr double CONTRADICTION = 5.0;                      // standard deviations
const double CLOCK_WANDER = SampleClockParameters().jump;  // [s]
constexpr double MILLI = 1e-3;                             // [s]

std::optional<Alignment> byMotion(const SampledSignal& late, const SampledSignal& position,
                                  const StreamShiftOptions& options) {
  // As much smoothing as between two reports of the position; no more, since it takes away the start.
  const SampledSignal acceleration{
      position.begin, position.rate,
      smoothedDerivative(position.values, position.rate, 2, 1.0 / position.rate)};
  const double rate = std::min(late.rate, MOTION_RATE * position.rate);
  const auto shift = shiftByCorrelation({onCommonTimes(late, acceleration, rate)}, rate, options);
  if (!shift) return {};
  return Alignment{AlignmentMethod::motion, *shift};
}

std::optional<Alignment> byCorrelation(const SampledSignal& late, const SampledSignal& early,
                                       const StreamShiftOptions& options) {
  const double rate = std::min(late.rate, early.rate);
  const auto shift = shiftByCorrelation({onCommonTimes(late, early, rate)}, rate, options);
  if (!shift) return {};
  return Alignment{AlignmentMethod::correlation, *shift};
}

}  // namespace

SignalName::SignalName(const std::string& text) {
  const std::size_t slash = text.rfind('/');
  if (slash == std::string::npos || slash == 0 || slash + 1 == text.size())
    throw Error("'" + text + "', expected TOPIC/CHANNEL");
  topic = text.substr(0, slash);
  channel = text.substr(slash + 1);
}

bool SignalName::ofController() const {
  return topic == names::CNC_STATE;
}

const char* methodName(AlignmentMethod method) {
  static constexpr std::array<const char*, 3> NAMES{"taps", "motion", "correlation"};
  return NAMES.at(static_cast<std::size_t>(method));
}

std::optional<Alignment> align(const SampledSignal& late, const SampledSignal& early, bool early_is_position,
                               const AlignmentOptions& options) {
  StreamShiftOptions shift_options;
  shift_options.range = options.range;
  const auto permits = [&](AlignmentMethod method) { return !options.only || *options.only == method; };
  if (early_is_position)
    return permits(AlignmentMethod::motion) ? byMotion(late, early, shift_options)
                                            : std::optional<Alignment>();
  if (permits(AlignmentMethod::taps)) {
    if (const auto shift = shiftByTaps(late, early, shift_options))
      return Alignment{AlignmentMethod::taps, *shift};
  }
  return permits(AlignmentMethod::correlation) ? byCorrelation(late, early, shift_options)
                                               : std::optional<Alignment>();
}

StreamAlignment::StreamAlignment(SignalName late, SignalName early, const AlignmentOptions& options)
    : late_(std::move(late)), early_(std::move(early)), options_(options) {
  if (late_.ofController())
    throw Error(late_.text() + ": a signal of the controller, expected as the second one");
  if (early_.ofController() && !axisIndex(early_.channel))
    throw Error(early_.text() + ": expected the axis x, y or z");
}

void StreamAlignment::push(const std::string& topic, const SampleBlock& block) {
  if (topic == late_.topic) late_window_.push(block, late_.channel);
  if (topic == early_.topic) early_window_.push(block, early_.channel);
  evaluateIfFull();
}

void StreamAlignment::push(const CncState& state) {
  if (!early_.ofController() || !state.connected) return;
  const auto axis = controllerAxis(state.axes, *axisIndex(early_.channel));
  if (axis && *axis < state.position.size()) early_window_.push(state.stamp, state.position[*axis]);
  evaluateIfFull();
}

void StreamAlignment::evaluateIfFull() {
  const double late = late_window_.length(), early = early_window_.length();
  if (std::min(late, early) >= options_.window) return evaluate();
  // The other one does not come.
  constexpr double MOST = 3.0;  // windows
  if (late > MOST * options_.window) late_window_.clear();
  if (early > MOST * options_.window) early_window_.clear();
}

void StreamAlignment::finish() {
  if (std::min(late_window_.length(), early_window_.length()) > 0.0) evaluate();
}

void StreamAlignment::evaluate() {
  ++records_;
  const auto found = align(late_window_.signal(), early_window_.signal(), early_.ofController(), options_);
  late_window_.clear();
  early_window_.clear();
  if (found) combine(*found);
}

void StreamAlignment::combine(const Alignment& found) {
  ++shown_;
  const double uncertainty =
      state_ ? std::hypot(state_->shift.std_dev, found.shift.std_dev) : found.shift.std_dev;
  const double apart = state_ ? std::abs(found.shift.delay - state_->shift.delay) : 0.0;
  if (apart > std::max(CONTRADICTION * uncertainty, CLOCK_WANDER)) {
    change_ = formatted("the shift of %s to %s has changed from %.3f ms to %.3f ms", late_.text().c_str(),
                        early_.text().c_str(), state_->shift.delay / MILLI, found.shift.delay / MILLI);
    state_.reset();
    shown_ = 1;
  }
  if (!state_ || state_->method != found.method) {
    // Of another method only where it is better.
    if (state_ && found.shift.std_dev >= state_->shift.std_dev) return;
    state_ = found;
    sums_ = {};
  }
  const double weight = std::pow(found.shift.std_dev, -2), delay = found.shift.delay;
  sums_[0] += 1.0;
  sums_[1] += weight;
  sums_[2] += weight * delay;
  sums_[3] += weight * delay * delay;
  if (sums_[0] < 2.0) return;
  StreamShift& shift = state_->shift;
  shift.delay = sums_[2] / sums_[1];
  // Records that scatter by more than they state: Birge ratio.
  const double ratio = (sums_[3] - sums_[2] * shift.delay) / (sums_[0] - 1.0);
  shift.std_dev = std::sqrt(std::max(1.0, ratio) / sums_[1]);
  shift.explained = std::max(shift.explained, found.shift.explained);
  shift.events += found.shift.events;
}

std::string StreamAlignment::takeChange() {
  return std::exchange(change_, {});
}

void StreamAlignment::Window::push(const SampleBlock& block, const std::string& channel) {
  const std::vector<double> column = block.column(channel);
  const bool follows = !values_.empty() && block.first_index == next_index_ && block.sample_rate == rate_;
  const bool finite = std::all_of(column.begin(), column.end(), [](double v) { return std::isfinite(v); });
  if (!follows || !finite) clear();
  if (!finite) return;
  if (values_.empty()) {
    begin_ = block.stamp;
    rate_ = block.sample_rate;
  }
  values_.insert(values_.end(), column.begin(), column.end());
  next_index_ = block.first_index + block.size();
}

void StreamAlignment::Window::push(double stamp, double value) {
  if (!times_.empty() && stamp <= times_.back()) clear();
  times_.push_back(stamp);
  values_.push_back(value);
}

double StreamAlignment::Window::length() const {
  if (values_.size() < 2) return 0.0;
  return times_.empty() ? static_cast<double>(values_.size()) / rate_ : times_.back() - times_.front();
}

SampledSignal StreamAlignment::Window::signal() const {
  if (times_.empty()) return {begin_, rate_, values_};
  // Reports of a controller come about evenly.
  SampledSignal even{times_.front(), static_cast<double>(times_.size() - 1) / length(), {}};
  std::size_t after = 1;
  for (std::size_t i = 0; i < times_.size(); ++i) {
    const double time = even.begin + static_cast<double>(i) / even.rate;
    while (after + 1 < times_.size() && times_[after] < time) ++after;
    const double share =
        std::clamp((time - times_[after - 1]) / (times_[after] - times_[after - 1]), 0.0, 1.0);
    even.values.push_back((1.0 - share) * values_[after - 1] + share * values_[after]);
  }
  return even;
}

void StreamAlignment::Window::clear() {
  times_.clear();
  values_.clear();
}

std::string alignmentText(const StreamAlignment& alignment) {
  const auto& state = alignment.state();
  const std::string pair = alignment.late().text() + " to " + alignment.early().text();
  if (!state) return pair + formatted(": no shift shows in %zu records", alignment.records());
  const StreamShift& shift = state->shift;
  return formatted("%s is %.3f ms (sd %.3f) %s than %s, by %s (%zu)", alignment.late().text().c_str(),
                   std::abs(shift.delay) / MILLI, shift.std_dev / MILLI,
                   shift.delay < 0.0 ? "earlier" : "later", alignment.early().text().c_str(),
                   methodName(state->method), shift.events);
}

}  // namespace smartmill::daq
