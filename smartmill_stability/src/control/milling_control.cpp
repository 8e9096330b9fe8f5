#include "smartmill_stability/control/milling_control.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double BACK_OFF = 5.0;      // [1] the feed falls so many times as fast as it rises
constexpr double LOAD_STEP = 0.02;    // [1] of the feed's override below which nothing is asked for
constexpr double REACHED = 0.01;      // [1] of the spindle's speed
constexpr double LONGEST_STEP = 1.0;  // [s] between two loads that belong together

double rpm(double speed) {
  return units::rpmFromRadPerSec(speed);
}

}  // namespace

MillingControl::MillingControl(const MillingControlParameters& parameters, int window, Believed believed)
    : parameters_(parameters), window_(window), believed_(std::move(believed)) {
  parameters_.validate();
}

void MillingControl::handle(const CuttingCondition& condition) {
  next_ = condition;
}

void MillingControl::begin(const CuttingCondition& condition) {
  const bool cut = condition.kind == CuttingCondition::Kind::cut;
  cut_ = cut ? std::optional<CuttingCondition>(condition) : std::nullopt;
  phase_ = Phase::watching;
  // The controller puts overrides back with the end of each program.
  spindle_ = feed_ = old_spindle_ = old_feed_ = load_share_ = 1.0;
  last_load_ = 0.0;
  moves_ = 0;
  refused_ = at_floor_ = false;
  request_.reset();
}

void MillingControl::handle(const CncState& state) {
  state_ = state;
  if (next_ && state.stamp >= next_->stamp) begin(*std::exchange(next_, std::nullopt));
  if (phase_ == Phase::watching || !cut_) return;
  const double wanted = cut_->spindle_speed * spindle_;
  const bool there = std::abs(state.spindle_speed - wanted) <= REACHED * wanted;
  if (phase_ == Phase::moving && there) {
    phase_ = Phase::settling;
    since_ = state.stamp;
  } else if (phase_ == Phase::moving && state.stamp - since_ > parameters_.settle_time) {
    notes_.push_back(formatted("%s: the spindle turns at %.0f rpm, the override asked for %.0f: given up",
                               cut_->name.c_str(), rpm(state.spindle_speed), rpm(wanted)));
    refused_ = true;
    phase_ = Phase::watching;
  }
}

bool MillingControl::mayAct() const {
  return parameters_.adaptive && cut_ && state_ && state_->connected && state_->armed && !refused_;
}

void MillingControl::ask(double feed, double spindle, const std::string& reason, bool chatter) {
  old_feed_ = std::exchange(feed_, feed);
  old_spindle_ = std::exchange(spindle_, spindle);
  request_ = OverrideRequest{feed_, spindle_, cut_->name + ": " + reason, chatter};
}

double MillingControl::feedFor(double spindle) const {
  // With the spindle, so that a chip keeps its thickness; above its limit it gets thinner.
  return std::clamp(spindle * load_share_, parameters_.feed_floor, parameters_.feed_high);
}

// --- load

void MillingControl::handle(const LoadSample& load) {
  const double before = std::exchange(last_load_, load.stamp), step = load.stamp - before;
  if (!mayAct() || parameters_.load_target == 0.0 || at_floor_) return;
  // Unknown, or the first after a silence: nothing follows from it.
  if (!std::isfinite(load.spindle_load) || !(step > 0.0) ||
      step > std::min(parameters_.load_timeout, LONGEST_STEP))
    return;
  const double wanted = load.spindle_load > 0.0
                            ? std::min(1.0, load_share_ * parameters_.load_target / load.spindle_load)
                            : 1.0;
  const double rise = parameters_.feed_rise * step;
  load_share_ =
      std::clamp(wanted, std::max(parameters_.feed_floor, load_share_ - BACK_OFF * rise), load_share_ + rise);
  load_share_ = std::min(1.0, load_share_);
  const double feed = feedFor(spindle_);
  const bool at_end = feed == parameters_.feed_floor || load_share_ == 1.0;
  if (std::abs(feed - feed_) < LOAD_STEP && !(at_end && feed != feed_)) return;
  if (request_) return;
  ask(feed, spindle_,
      formatted("spindle load %.0f %%, feed to %.0f %%", 100.0 * load.spindle_load, 100.0 * feed), false);
}

// --- chatter

void MillingControl::handle(const ChatterState& state) {
  if (phase_ != Phase::settling || !state_ || !state.valid || !cut_) return;
  const double turn = units::TWO_PI / (cut_->spindle_speed * spindle_);
  if (state.stamp - window_ * turn < since_ + parameters_.settle_revolutions * turn) return;
  phase_ = Phase::watching;
  if (state.chatter) return;
  notes_.push_back(formatted("%s: the cut has settled at %.0f rpm, %.2f s after the override",
                             cut_->name.c_str(), rpm(cut_->spindle_speed * spindle_),
                             state.stamp - moved_at_));
}

std::optional<UncertainSystem> MillingControl::systemOf(const ChatterAdvice& advice) const {
  const std::optional<UncertainSystem> believed = believed_(advice.engagement);
  if (!believed || !advice.correction) return believed;
  return believed->about(advice.correction->system);
}

void MillingControl::handle(const ChatterAdvice& advice) {
  if (!mayAct() || advice.episode.condition != cut_->name || phase_ != Phase::watching || at_floor_) return;
  if (!(advice.depth > 0.0)) return;
  const std::optional<UncertainSystem> system = systemOf(advice);
  if (moves_ >= parameters_.moves) {
    backOff(advice, system ? &*system : nullptr);
  } else if (!system) {
    stepAside(advice);
  } else if (const auto found = stableSpeed(*system, advice.depth, lowest(), highest(), riskOptions())) {
    goTo(advice, *found, advice.correction.has_value());
  } else {
    backOff(advice, &*system);
  }
}

RiskOptions MillingControl::riskOptions() const {
  RiskOptions options;
  options.risk = parameters_.risk;
  options.speed_margin = parameters_.speed_margin;
  return options;
}

void MillingControl::goTo(const ChatterAdvice& advice, const StableSpeed& speed, bool corrected) {
  const double spindle = speed.speed / cut_->spindle_speed;
  ++moves_;
  phase_ = Phase::moving;
  since_ = moved_at_ = advice.stamp;
  ask(feedFor(spindle), spindle,
      formatted("chatter at %.0f Hz, %.0f rpm: spindle to %.0f rpm (%.1f %%), feed to %.1f %%; %.2f mm are "
                "stable there from %.0f to %.0f rpm, chatter with probability %.0f %%%s",
                advice.episode.frequency, rpm(advice.speed), rpm(speed.speed), 100.0 * spindle,
                100.0 * feedFor(spindle), advice.depth / units::MM, rpm(speed.below), rpm(speed.above),
                100.0 * speed.probability, corrected ? " by the corrected machine" : ""),
      true);
}

/// Nothing is known of the machine: the nearest speed in step with the chatter, once a move.
void MillingControl::stepAside(const ChatterAdvice& advice) {
  double best = 0.0;
  for (const ChatterAdvice::Speed& s : advice.speeds) {
    const bool within = s.speed >= lowest() && s.speed <= highest();
    const bool nearer = std::abs(s.speed - advice.speed) < std::abs(best - advice.speed);
    if (within && nearer) best = s.speed;
  }
  if (best == 0.0 || std::abs(best / advice.speed - 1.0) < REACHED) {
    backOff(advice, nullptr);
    return;
  }
  const double spindle = best / cut_->spindle_speed;
  ++moves_;
  phase_ = Phase::moving;
  since_ = moved_at_ = advice.stamp;
  ask(feedFor(spindle), spindle,
      formatted(
          "chatter at %.0f Hz, %.0f rpm: spindle to %.0f rpm (%.1f %%), where the teeth pass in step with "
          "it; no modes are known",
          advice.episode.frequency, rpm(advice.speed), rpm(best), 100.0 * spindle),
      true);
}

void MillingControl::backOff(const ChatterAdvice& advice, const UncertainSystem* system) {
  constexpr double SHALLOWER = 0.05, LEAST = 0.1;  // [1] of the depth
  at_floor_ = true;
  double speed = 0.0, depth = 0.0;
  for (double share = 1.0; system && share > LEAST; share -= SHALLOWER) {
    // A shallower cut cannot remove more than at the highest speed.
    if (share * advice.depth * highest() <= speed * depth) break;
    const auto found = stableSpeed(*system, share * advice.depth, lowest(), highest(), riskOptions());
    if (!found || found->speed * share * advice.depth <= speed * depth) continue;
    speed = found->speed;
    depth = share * advice.depth;
  }
  const std::string next =
      depth > 0.0 ? formatted("; the next cut: %.2f mm at %.0f rpm", depth / units::MM, rpm(speed)) : "";
  ask(parameters_.feed_floor, spindle_,
      formatted(
          "chatter at %.0f Hz, %.0f rpm: no speed from %.0f to %.0f rpm is found that bears %.2f mm; feed "
          "to %.0f %%%s",
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

void MillingControl::answer(bool taken, const std::string& message) {
  if (taken) return;
  feed_ = old_feed_;
  spindle_ = old_spindle_;
  phase_ = Phase::watching;
  refused_ = true;
  notes_.push_back((cut_ ? cut_->name + ": " : "") + "overrides stay as they are: " + message);
}

std::vector<std::string> MillingControl::takeNotes() {
  return std::exchange(notes_, {});
}

}  // namespace smartmill::stability
