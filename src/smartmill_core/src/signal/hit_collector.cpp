#include "smartmill_core/signal/hit_collector.h"

#include <cmath>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill {

HitCollector::HitCollector(const HitCollectorOptions& options) : options_(options) {
  if (!(options.trigger_force > 0.0 && options.pre_trigger > 0.0 &&
        options.record_length > options.pre_trigger)) {
    throw Error("hit collector: expected trigger_force > 0 and 0 < pre_trigger < record_length, got " +
                std::to_string(options.trigger_force) + " N, " + std::to_string(options.pre_trigger) +
                " and " + std::to_string(options.record_length) + " s");
  }
}

void HitCollector::arm() {
  armed_ = true;
  recording_ = false;
}

void HitCollector::disarm() {
  armed_ = recording_ = false;
}

void HitCollector::reset() {
  disarm();
  clearPreTrigger();
  rate_ = 0.0;
}

void HitCollector::clearPreTrigger() {
  force_before_.clear();
  volt_before_.clear();
  sum_before_ = 0.0;
}

std::optional<HitCollector::Record> HitCollector::add(double time, std::uint64_t index, double rate,
                                                      double force, double volt) {
  if (rate != rate_ || index != next_index_) {
    if (recording_ && fault_.empty()) {
      fault_ = rate != rate_
                   ? "the sample rate changed within the record"
                   : "samples " + std::to_string(next_index_) + ".." + std::to_string(index) + " are missing";
    }
    clearPreTrigger();  // none across a gap
    rate_ = rate;
  }
  next_index_ = index + 1;
  const auto pre = static_cast<std::size_t>(std::lround(options_.pre_trigger * rate));
  const auto total = static_cast<std::size_t>(std::lround(options_.record_length * rate));
  if (recording_) {
    hit_.force.push_back(force);
    hit_.response.push_back(volt);
    if (fault_.empty() && !(std::isfinite(force) && std::isfinite(volt))) {
      fault_ = "sample " + std::to_string(index) + " is not a number";
    }
    if (hit_.force.size() < total) return std::nullopt;
    recording_ = armed_ = false;
    clearPreTrigger();
    return Record{std::move(hit_), std::move(fault_)};
  }
  // The running sum, of which only rounding errors are wrong, decides whether to compute the mean.
  if (armed_ && force_before_.size() >= pre &&
      !(force - sum_before_ / static_cast<double>(pre) < 0.5 * options_.trigger_force)) {
    double base = 0.0;
    for (const double f : force_before_) base += f / static_cast<double>(pre);
    sum_before_ = base * static_cast<double>(pre);
    if (std::isfinite(base) && force - base > options_.trigger_force) {
      recording_ = true;
      fault_.clear();
      hit_ = Hit();
      hit_.stamp = time;
      hit_.sample_rate = rate;
      hit_.pre_trigger = pre;
      hit_.force.assign(force_before_.begin(), force_before_.end());
      hit_.response.assign(volt_before_.begin(), volt_before_.end());
      hit_.force.push_back(force);
      hit_.response.push_back(volt);
      if (!std::isfinite(volt)) fault_ = "sample " + std::to_string(index) + " is not a number";
      return std::nullopt;
    }
  }
  force_before_.push_back(force);
  volt_before_.push_back(volt);
  sum_before_ += force;
  while (force_before_.size() > pre) {
    sum_before_ -= force_before_.front();
    force_before_.pop_front();
    volt_before_.pop_front();
  }
  return std::nullopt;
}

}  // namespace smartmill
