#include "smartmill_kalman/tuning/tuning_records.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/signal/force_channels.h"

namespace smartmill::kalman {

void TuningRecords::handle(const CuttingCondition& condition) {
  closeSegment();
  kind_ = condition.kind;
  next_index_.reset();
  valid_ = true;
  TuningRecord& record = kind_ == CuttingCondition::Kind::cut ? cut_ : air_;
  record = {};
}

void TuningRecords::handle(const SampleBlock& forces) {
  if (!kind_ || *kind_ == CuttingCondition::Kind::none || !valid_ || !(speed_ > 0.0)) return;
  const bool in_cut = *kind_ == CuttingCondition::Kind::cut;
  TuningRecord& record = in_cut ? cut_ : air_;
  if (record.speed == 0.0) {
    record.speed = speed_;
    record.sample_rate = forces.sample_rate;
  }
  if (std::abs(speed_ / record.speed - 1.0) > options_.speed_tolerance ||
      (next_index_ && *next_index_ != forces.first_index)) {
    // The spindle runs up, or samples are missing: air begins again, a cut has lost its entry.
    if (in_cut) valid_ = false;
    record = {};
    next_index_.reset();
    return;
  }
  next_index_ = forces.first_index + forces.size();
  const auto most = static_cast<std::size_t>(options_.length * forces.sample_rate);
  auto& samples = in_cut ? record.cut : record.air;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t column = forces.channel(FORCE_CHANNELS[axis]);
    std::vector<double>& to = samples[axis];
    if (in_cut && to.size() >= most) continue;
    for (std::size_t i = 0; i < forces.size(); ++i) {
      to.push_back(forces.at(i, column));
      if (!std::isfinite(to.back())) valid_ = false;
    }
    if (!in_cut && to.size() > 2 * most) to.erase(to.begin(), to.end() - static_cast<std::ptrdiff_t>(most));
  }
}

void TuningRecords::closeSegment() {
  if (kind_ != CuttingCondition::Kind::cut || !valid_ || cut_.speed == 0.0 || air_.speed == 0.0) return;
  if (std::abs(air_.speed / cut_.speed - 1.0) > options_.same_speed) return;
  TuningRecord pair = std::exchange(cut_, {});
  pair.air = air_.air;
  const auto same = std::find_if(records_.begin(), records_.end(), [&](const auto& known) {
    return std::abs(known.first / pair.speed - 1.0) < options_.same_speed;
  });
  if (same != records_.end()) records_.erase(same);
  if (records_.size() < options_.most_speeds) records_[pair.speed] = std::move(pair);
}

std::vector<TuningRecord> TuningRecords::records() const {
  std::vector<TuningRecord> all;
  for (const auto& [speed, record] : records_) all.push_back(record);
  return all;
}

}  // namespace smartmill::kalman
