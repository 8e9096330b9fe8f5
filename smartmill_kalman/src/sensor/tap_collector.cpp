#include "smartmill_kalman/sensor/tap_collector.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/signal/same_time.h"

namespace smartmill::kalman {
namespace {

constexpr std::size_t MAX_WAITING = 1000000;  // samples of one stream without the other's index

}  // namespace

TapCollector::TapCollector(const TapParameters& taps, std::size_t channels)
    : collectors_(channels, HitCollector({taps.trigger_force, taps.pre_trigger, taps.record_length})) {
}

void TapCollector::begin() {
  end();
  hits_.clear();
  active_ = true;
}

void TapCollector::end() {
  active_ = false;
  hammer_.clear();
  samples_.clear();
  for (HitCollector& collector : collectors_) collector.reset();
}

void TapCollector::handleHammer(const SampleBlock& block) {
  if (!active_) return;
  const std::size_t c = block.channel("hammer");
  for (std::size_t i = 0; i < block.size(); ++i) hammer_.push_back({block.first_index + i, block.at(i, c)});
  pairSamples();
}

void TapCollector::add(double time, std::uint64_t index, double rate, std::vector<double> values) {
  if (!active_) return;
  samples_.push_back({time, index, rate, std::move(values)});
  pairSamples();
}

void TapCollector::pairSamples() {
  while (!hammer_.empty() && !samples_.empty()) {
    const Force h = hammer_.front();
    const std::uint64_t index = samples_.front().index;
    if (h.index <= index) hammer_.pop_front();
    if (index > h.index) continue;
    const Sample s = std::move(samples_.front());
    samples_.pop_front();
    if (h.index != index) continue;
    rate_ = s.rate;
    std::vector<Hit> hit;
    for (std::size_t c = 0; c < collectors_.size(); ++c) {
      HitCollector& collector = collectors_[c];
      if (!collector.armed() && !collector.recording()) collector.arm();
      auto record = collector.add(s.time, s.index, s.rate, h.force, s.values.at(c));
      if (record && record->fault.empty()) hit.push_back(std::move(record->hit));
    }
    if (hit.size() == collectors_.size()) hits_.push_back(std::move(hit));
  }
  if (std::max(hammer_.size(), samples_.size()) > MAX_WAITING) end();
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
