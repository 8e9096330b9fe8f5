#include "smartmill_kalman/sensor/tap_collector.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "smartmill_core/signal/same_time.h"

namespace smartmill::kalman {

TapCollector::TapCollector(const TapParameters& taps, std::size_t channels)
    : pairs_(taps.strike_timeout),
      collectors_(channels, HitCollector({taps.trigger_force, taps.pre_trigger, taps.record_length})) {
}

void TapCollector::begin() {
  end();
  hits_.clear();
  active_ = true;
}

void TapCollector::end() {
  active_ = false;
  pairs_.clear();
  for (HitCollector& collector : collectors_) collector.reset();
}

void TapCollector::handleHammer(const SampleBlock& block) {
  if (!active_) return;
  pairs_.addHammer(block);
  handlePairs();
}

void TapCollector::add(double time, std::uint64_t index, double rate, std::vector<double> values) {
  if (!active_) return;
  pairs_.addResponse(time, index, rate, std::move(values));
  handlePairs();
}

void TapCollector::handlePairs() {
  while (const std::optional<TapPairs::Pair> pair = pairs_.next()) {
    rate_ = pair->rate;
    std::vector<Hit> hit;
    for (std::size_t c = 0; c < collectors_.size(); ++c) {
      HitCollector& collector = collectors_[c];
      if (!collector.armed() && !collector.recording()) collector.arm();
      auto record = collector.add(pair->time, pair->index, pair->rate, pair->force, pair->response.at(c));
      if (record && record->fault.empty()) hit.push_back(std::move(record->hit));
    }
    if (hit.size() == collectors_.size()) hits_.push_back(std::move(hit));
  }
  if (!pairs_.fault().empty()) end();  // SensorMeasurement reports it
}

std::vector<std::vector<Hit>> TapCollector::acceptedHits(const SensorResult& result) const {
  std::vector<std::vector<Hit>> good;
  for (const std::vector<Hit>& hit : hits_) {
    const double stamp = hit[0].stamp;
    if (std::any_of(result.hit_stamps.begin(), result.hit_stamps.end(),
                    [stamp](double s) { return std::abs(s - stamp) < SAME_TIME; }))
      good.push_back(hit);
  }
  return good;
}

}  // namespace smartmill::kalman
