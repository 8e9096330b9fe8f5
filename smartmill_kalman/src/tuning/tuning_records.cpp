#include "smartmill_kalman/tuning/tuning_records.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::kalman {

void TuningRecords::handle(const CuttingCondition& condition) {
  closeSegment();
  kind_ = condition.kind;
  next_index_.reset();
  valid_ = true;
  complete_ = false;
  // Between the programs of a session there is no condition; the air before it stays.
  if (kind_ == CuttingCondition::Kind::cut) cut_ = {};
  if (kind_ == CuttingCondition::Kind::air) air_ = {};
}

void TuningRecords::handle(const SampleBlock& forces) {
  const bool in_cut = kind_ == CuttingCondition::Kind::cut;
  if ((!in_cut && kind_ != CuttingCondition::Kind::air) || complete_ || !(speed_ > 0.0)) return;
  TuningRecord& record = in_cut ? cut_ : air_;
  auto& samples = in_cut ? record.cut : record.air;
  const bool is_broken =
      record.speed > 0.0 && (std::abs(speed_ / record.speed - 1.0) > options_.speed_tolerance ||
                             (next_index_ && *next_index_ != forces.first_index));
  if (is_broken) {  // the spindle runs up or down, or samples are missing
    complete_ = static_cast<double>(samples[0].size()) >= options_.least * record.sample_rate;
    if (complete_) return;
    record = {};
  }
  if (record.speed == 0.0) {
    record.speed = speed_;
    record.sample_rate = forces.sample_rate;
  }
  next_index_ = forces.first_index + forces.size();
  const auto most =
      static_cast<std::size_t>((in_cut ? options_.cut_length : options_.air_length) * forces.sample_rate);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t column = forces.channel(FORCE_CHANNELS[axis]);
    std::vector<double>& to = samples[axis];
    for (std::size_t i = 0; i < forces.size() && !(in_cut && to.size() >= most); ++i) {
      to.push_back(forces.at(i, column));
      if (!std::isfinite(to.back())) valid_ = false;
    }
    if (!in_cut && to.size() > 2 * most) to.erase(to.begin(), to.end() - static_cast<std::ptrdiff_t>(most));
  }
  if (in_cut) complete_ = samples[0].size() >= most;
}

bool TuningRecords::startsInAir() const {
  const auto count = static_cast<std::size_t>(options_.entry * cut_.sample_rate);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<double>&air = air_.air[axis], &cut = cut_.cut[axis];
    if (air.empty() || cut.size() < count) return false;
    const double level = mean(air), noise = standardDeviation(air);
    double squares = 0.0;
    for (std::size_t i = 0; i < count; ++i) squares += (cut[i] - level) * (cut[i] - level);
    if (std::sqrt(squares / static_cast<double>(count)) > options_.quiet * noise) return false;
  }
  return true;
}

void TuningRecords::closeSegment() {
  if (kind_ != CuttingCondition::Kind::cut || !valid_ || cut_.speed == 0.0 || air_.speed == 0.0) return;
  if (std::abs(air_.speed / cut_.speed - 1.0) > options_.same_speed || !startsInAir()) return;
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
