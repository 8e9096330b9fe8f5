#include "smartmill_core/signal/angle_selector.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill {

AngleSelector::AngleSelector(std::vector<Source> sources)
    : sources_(std::move(sources)), entries_(sources_.size()) {
}

void AngleSelector::reset() {
  entries_.assign(sources_.size(), {});
  active_.reset();
  related_ = false;
  now_ = -std::numeric_limits<double>::infinity();
  track_ = AngleTrack();
  last_ = SpindleAngle();
}

std::vector<SpindleAngle> AngleSelector::push(std::size_t source, const SpindleAngle& reading) {
  // Streams may be behind each other, but not by more than what is kept.
  if (reading.stamp < now_ - AngleTrack::HISTORY) reset();
  Entry& entry = entries_[source];
  std::vector<SpindleAngle> out;
  if (reading.stamp <= entry.newest) return out;
  if (!(reading.stamp - entry.newest <= sources_[source].timeout)) {
    entry.has_failed = std::isfinite(entry.newest);
    entry.since = reading.stamp;
    entry.recent.clear();
  }
  entry.newest = reading.stamp;
  entry.angle_known = std::isfinite(reading.angle);
  entry.recent.push_back(reading);
  while (entry.recent.front().stamp < reading.stamp - AngleTrack::REACH) entry.recent.pop_front();
  now_ = std::max(now_, reading.stamp);
  choose(out);
  if (active_ == source) {
    publish(reading, out);
  } else {
    learn(source, reading);
  }
  return out;
}

std::vector<SpindleAngle> AngleSelector::advance(double time) {
  std::vector<SpindleAngle> out;
  now_ = std::max(now_, time);
  choose(out);
  return out;
}

void AngleSelector::forgetOffset(std::size_t source) {
  Entry& entry = entries_[source];
  entry.difference = 0.0;
  entry.weight = entry.squares = 0.0;
  if (active_ != source) return;
  entry.offset = 0.0;
  related_ = false;
  change_ = sources_[source].name + ": begun anew; up to a constant, tooth 1 is not known";
}

bool AngleSelector::works(std::size_t source) const {
  return now_ - entries_[source].newest <= sources_[source].timeout;
}

void AngleSelector::learn(std::size_t source, const SpindleAngle& reading) {
  const std::optional<double> angle = track_.at(reading.stamp);
  if (!angle || !std::isfinite(*angle) || !std::isfinite(reading.angle) || !related_) return;
  Entry& entry = entries_[source];
  const double kept = std::exp(-std::max(0.0, reading.stamp - entry.related_to) / AVERAGED);
  entry.difference = kept * entry.difference + std::polar(1.0, *angle - reading.angle);
  entry.weight = kept * entry.weight + 1.0;
  entry.squares = kept * kept * entry.squares + 1.0;
  entry.related_to = reading.stamp;
}

void AngleSelector::choose(std::vector<SpindleAngle>& out) {
  std::optional<std::size_t> best;
  for (std::size_t s = 0; s < sources_.size(); ++s) {
    if (!works(s)) continue;
    // A better one that has failed must have worked for a while.
    const bool held = !active_ || s >= *active_ || !works(*active_) || !entries_[s].has_failed ||
                      now_ - entries_[s].since >= HOLD;
    if (!held) continue;
    if (!best) best = s;
    if (entries_[s].angle_known) {
      best = s;
      break;
    }
  }
  if (!best || best == active_) return;
  const std::optional<std::size_t> before = std::exchange(active_, best);
  Entry& entry = entries_[*best];
  const Source& source = sources_[*best];
  const bool known = entry.weight > 0.0;
  entry.offset = known ? std::arg(entry.difference) : 0.0;
  // A source with a zero of its own, the best of all that have worked, defines the angle.
  if (source.absolute && (!before || *best < *before)) {
    entry.offset = 0.0;
    related_ = true;
  } else {
    related_ = source.absolute || known;
  }
  change_ = before ? formatted("%s in place of %s", source.name.c_str(), sources_[*before].name.c_str())
                   : source.name;
  if (before && !works(*before))
    change_ += formatted(": no reading for %.2f s", now_ - entries_[*before].newest);
  if (before && *best < *before) change_ += ": works";
  if (!related_) change_ += "; up to a constant, tooth 1 is not known";
  for (const SpindleAngle& reading : entry.recent)
    if (reading.stamp > last_.stamp && reading.stamp < entry.newest) publish(reading, out);
  // The newest one, unless it is published by push().
  if (!entry.recent.empty() && entry.newest > last_.stamp && now_ > entry.newest)
    publish(entry.recent.back(), out);
}

void AngleSelector::publish(const SpindleAngle& reading, std::vector<SpindleAngle>& out) {
  if (reading.stamp <= last_.stamp) return;
  last_ = reading;
  if (std::isfinite(reading.angle)) last_.angle = wrapped(reading.angle + entries_[*active_].offset);
  track_.push(last_);
  out.push_back(last_);
}

bool AngleSelector::related() const {
  return related_;
}

AngleSelector::State AngleSelector::state(std::size_t source) const {
  const Entry& entry = entries_[source];
  State state;
  state.working = works(source);
  state.newest = entry.newest;
  state.offset_known = entry.weight > 0.0;
  state.offset = active_ == source ? entry.offset : state.offset_known ? std::arg(entry.difference) : 0.0;
  if (state.offset_known) {
    // Circular standard deviation, of the average over the effective number of readings.
    const double length = std::min(1.0, std::abs(entry.difference) / entry.weight);
    const double number = entry.weight * entry.weight / entry.squares;
    state.offset_std = length > 0.0 ? std::sqrt(std::max(0.0, -2.0 * std::log(length)) / number) : units::PI;
  }
  return state;
}

std::string AngleSelector::takeChange() {
  return std::exchange(change_, {});
}

}  // namespace smartmill
