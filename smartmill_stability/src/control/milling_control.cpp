#include "smartmill_stability/control/milling_control.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

struct MillingControlOptions {
  double fall_over_rise =
      5.0;                  ///< [1] rate of decrease of the feed over its rate of increase: overload is worse
  double load_step = 0.02;  ///< [1] smallest change of the feed override by the load; spares the controller
  double reached = 0.01;    ///< [1] relative tolerance of the spindle speed, the effect of load
  double longest_step = 1.0;  ///< [s] longest interval between two loads over which the feed changes
  /// [1] Steps of the depth of the proposed next cut, and the least one over the depth of this.
  double depth_step = 0.05, least_depth = 0.1;
  double least_probability = 0.1;  ///< [1] of a stable cut at a speed that is worth a move
};
constexpr MillingControlOptions CONTROL;

double rpm(double speed) {
  return units::rpmFromRadPerSec(speed);
}

}  // namespace

MillingControl::MillingControl(const MillingControlParameters& parameters, int window, Estimate estimate)
    : parameters_(parameters), window_(window), estimate_(std::move(estimate)) {
  parameters_.validate();
}

void MillingControl::handle(const CuttingCondition& condition) {
  next_ = condition;
}

void MillingControl::begin(const CuttingCondition& condition) {
  const bool cut = condition.kind == CuttingCondition::Kind::cut;
  cut_ = cut ? std::optional<CuttingCondition>(condition) : std::nullopt;
  phase_ = Phase::watching;
  // The controller resets the overrides at the end of each program.
  spindle_ = feed_ = old_spindle_ = old_feed_ = load_factor_ = 1.0;
  last_load_ = 0.0;
  moves_ = 0;
  refused_ = at_floor_ = false;
  search_.reset();
  request_.reset();
}

void MillingControl::handle(const CncState& state) {
  state_ = state;
  if (next_ && state.stamp >= next_->stamp) begin(*std::exchange(next_, std::nullopt));
  if (phase_ == Phase::watching || !cut_) return;
  const double requested = cut_->spindle_speed * spindle_;
  const bool reached = std::abs(state.spindle_speed - requested) <= CONTROL.reached * requested;
  if (phase_ == Phase::moving && reached) {
    phase_ = Phase::settling;
    since_ = state.stamp;
  } else if (phase_ == Phase::moving && state.stamp - since_ > parameters_.settle_time) {
    notes_.push_back(
        formatted("%s: spindle speed %.0f rpm, expected %.0f rpm by the override: no further overrides",
                  cut_->name.c_str(), rpm(state.spindle_speed), rpm(requested)));
    refused_ = true;
    phase_ = Phase::watching;
  }
}

bool MillingControl::mayAct() const {
  return parameters_.adaptive && cut_ && state_ && state_->connected && state_->armed && !refused_;
}

void MillingControl::request(double feed, double spindle, const std::string& reason, bool chatter) {
  old_feed_ = std::exchange(feed_, feed);
  old_spindle_ = std::exchange(spindle_, spindle);
  if (chatter) requested_at_ = state_->stamp;
  request_ = OverrideRequest{feed_, spindle_, cut_->name + ": " + reason, chatter};
}

double MillingControl::feedFor(double spindle) const {
  // In proportion to the spindle, which keeps the feed per tooth; above feed_high it decreases.
  return std::clamp(spindle * load_factor_, parameters_.feed_floor, parameters_.feed_high);
}

// --- load

void MillingControl::handle(const LoadSample& load) {
  const double before = std::exchange(last_load_, load.stamp), step = load.stamp - before;
  if (!mayAct() || parameters_.load_target == 0.0 || at_floor_) return;
  // An unknown load and the first one after a gap are ignored.
  if (!std::isfinite(load.spindle_load) || !(step > 0.0) ||
      step > std::min(parameters_.load_timeout, CONTROL.longest_step))
    return;
  const double target = load.spindle_load > 0.0
                            ? std::min(1.0, load_factor_ * parameters_.load_target / load.spindle_load)
                            : 1.0;
  const double rise = parameters_.feed_rise * step;
  load_factor_ =
      std::clamp(target, std::max(parameters_.feed_floor, load_factor_ - CONTROL.fall_over_rise * rise),
                 load_factor_ + rise);
  load_factor_ = std::min(1.0, load_factor_);
  const double feed = feedFor(spindle_);
  const bool at_end = feed == parameters_.feed_floor || load_factor_ == 1.0;
  if (std::abs(feed - feed_) < CONTROL.load_step && !(at_end && feed != feed_)) return;
  if (request_) return;
  request(feed, spindle_,
          formatted("spindle load %.0f %%: feed to %.0f %%", 100.0 * load.spindle_load, 100.0 * feed), false);
}

// --- chatter

void MillingControl::handle(const ChatterState& state) {
  if (phase_ != Phase::settling || !state_ || !state.valid || !cut_) return;
  const double turn = units::TWO_PI / (cut_->spindle_speed * spindle_);
  if (state.stamp - window_ * turn < since_ + parameters_.settle_revolutions * turn) return;
  phase_ = Phase::watching;
  if (state.chatter) return;
  notes_.push_back(formatted("%s: cut stable at %.0f rpm, %.2f s after the verdict of chatter",
                             cut_->name.c_str(), rpm(cut_->spindle_speed * spindle_),
                             state.stamp - requested_at_));
}

std::optional<UncertainSystem> MillingControl::systemOf(const ChatterAdvice& advice) const {
  const std::optional<UncertainSystem> estimate = estimate_(advice.engagement);
  if (!estimate || !advice.correction) return estimate;
  return estimate->about(advice.correction->system);
}

void MillingControl::handle(const ChatterAdvice& advice) {
  if (!mayAct() || advice.episode.condition != cut_->name || phase_ != Phase::watching || at_floor_) return;
  if (!(advice.depth > 0.0)) return;
  const std::optional<UncertainSystem> system = systemOf(advice);
  if (moves_ >= parameters_.moves) {
    reduceFeed(advice, system ? &*system : nullptr);
  } else if (!system) {
    moveWithoutModel(advice);
  } else if (const auto found = stableSpeed(*system, advice.depth, lowest(), highest(), riskOptions())) {
    moveTo(advice, *found, advice.correction.has_value());
  } else {
    reduceFeed(advice, &*system);
  }
}

RiskOptions MillingControl::riskOptions() const {
  RiskOptions options;
  options.risk = parameters_.risk;
  options.speed_margin = parameters_.speed_margin;
  return options;
}

void MillingControl::moveTo(const ChatterAdvice& advice, const StableSpeed& speed, bool corrected) {
  const double spindle = speed.speed / cut_->spindle_speed;
  ++moves_;
  phase_ = Phase::requested;
  request(
      feedFor(spindle), spindle,
      formatted("chatter at %.0f Hz, %.0f rpm: spindle to %.0f rpm (%.1f %%), feed to %.1f %%; depth %.2f mm "
                "stable from %.0f to %.0f rpm, probability of chatter %.0f %%%s",
                advice.episode.frequency, rpm(advice.speed), rpm(speed.speed), 100.0 * spindle,
                100.0 * feedFor(spindle), advice.depth / units::MM, rpm(speed.below), rpm(speed.above),
                100.0 * speed.probability, corrected ? " (corrected machine)" : ""),
      true);
}

/// Moves to the speed that SpeedSearch proposes from the chatter heard in this cut; for unknown modes.
void MillingControl::moveWithoutModel(const ChatterAdvice& advice) {
  if (advice.teeth < 1 || !(advice.episode.frequency > 0.0)) {
    reduceFeed(advice, nullptr);
    return;
  }
  if (!search_) search_.emplace(advice.teeth, lowest(), highest());
  search_->heard({std::clamp(advice.speed, lowest(), highest()), advice.episode.frequency});
  const SpeedProposal next = search_->next();
  if (next.stable < CONTROL.least_probability) {
    reduceFeed(advice, nullptr);
    return;
  }
  const double spindle = next.speed / cut_->spindle_speed;
  ++moves_;
  phase_ = Phase::requested;
  request(feedFor(spindle), spindle,
          formatted("chatter at %.0f Hz, %.0f rpm: spindle to %.0f rpm (%.1f %%), stable there with a "
                    "probability of %.0f %%; modes unknown",
                    advice.episode.frequency, rpm(advice.speed), rpm(next.speed), 100.0 * spindle,
                    100.0 * next.stable),
          true);
}

void MillingControl::reduceFeed(const ChatterAdvice& advice, const UncertainSystem* system) {
  at_floor_ = true;
  double speed = 0.0, depth = 0.0;
  for (double share = 1.0; system && share > CONTROL.least_depth; share -= CONTROL.depth_step) {
    // Upper bound of the removal rate of all shallower cuts.
    if (share * advice.depth * highest() <= speed * depth) break;
    const auto found = stableSpeed(*system, share * advice.depth, lowest(), highest(), riskOptions());
    if (!found || found->speed * share * advice.depth <= speed * depth) continue;
    speed = found->speed;
    depth = share * advice.depth;
  }
  const std::string next = depth > 0.0 ? formatted("; proposed for the next cut: %.2f mm at %.0f rpm",
                                                   depth / units::MM, rpm(speed))
                                       : "";
  request(parameters_.feed_floor, spindle_,
          formatted("chatter at %.0f Hz, %.0f rpm: no speed from %.0f to %.0f rpm stable at %.2f mm; feed to "
                    "%.0f %%%s",
                    advice.episode.frequency, rpm(advice.speed), rpm(lowest()), rpm(highest()),
                    advice.depth / units::MM, 100.0 * parameters_.feed_floor, next.c_str()),
          true);
  request_->next_speed = speed;
  request_->next_depth = depth;
}

// --- the controller

std::optional<OverrideRequest> MillingControl::takeRequest() {
  return std::exchange(request_, std::nullopt);
}

void MillingControl::answer(bool accepted, const std::string& message, double stamp) {
  if (accepted) {
    if (phase_ != Phase::requested) return;
    phase_ = Phase::moving;
    since_ = stamp;
    return;
  }
  feed_ = old_feed_;
  spindle_ = old_spindle_;
  phase_ = Phase::watching;
  refused_ = true;
  notes_.push_back((cut_ ? cut_->name + ": " : "") + "overrides unchanged: " + message);
}

std::vector<std::string> MillingControl::takeNotes() {
  return std::exchange(notes_, {});
}

}  // namespace smartmill::stability
