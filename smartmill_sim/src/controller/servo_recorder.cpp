#include "smartmill_sim/controller/servo_recorder.h"

#include <cmath>
#include <utility>

namespace smartmill::sim {

void ServoRecorder::push(const Input& input) {
  for (std::size_t i = 0; i < 3; ++i) cut_[i] += input.force[i];
  ++cut_count_;
  const std::uint64_t index = static_cast<std::uint64_t>(std::floor(input.time * SAMPLE_RATE + 1e-9));
  if (started_ && index < index_) return;
  const double step = started_ ? input.time - last_time_ : 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double v = input.motion.velocity[i];
    const double acceleration = step > 0.0 ? (v - last_velocity_[i]) / step : 0.0;
    const double cut = cut_[i] / static_cast<double>(cut_count_);
    current_[i] =
        drives_[i].force(input.motion.position[i], v, acceleration, cut) / drives_[i].force_per_ampere;
    last_velocity_[i] = v;
    cut_[i] = 0.0;
  }
  cut_count_ = 0;
  last_time_ = input.time;
  triggered_ = triggered_ || (trigger_ > 0 && input.motion.sequence == trigger_ && sequence_ != trigger_);
  sequence_ = input.motion.sequence;
  if (samples_.empty()) block_index_ = index;
  index_ = index + 1;
  started_ = true;
  samples_.push_back(input.spindle_load);
  samples_.insert(samples_.end(), current_.begin(), current_.end());
  samples_.insert(samples_.end(), last_velocity_.begin(), last_velocity_.end());
  samples_.push_back(sequence_);
  samples_.push_back(triggered_ ? 1.0 : 0.0);
}

SampleBlock ServoRecorder::take() {
  SampleBlock block;
  block.stamp = static_cast<double>(block_index_) / SAMPLE_RATE;
  block.sample_rate = SAMPLE_RATE;
  block.first_index = block_index_;
  block.channels = {"spindle_load", "current_x", "current_y", "current_z", "axis_vx",
                    "axis_vy",      "axis_vz",   "sequence",  "trigger"};
  block.units = {"1", "A", "A", "A", "m/s", "m/s", "m/s", "1", "1"};
  block.samples = std::exchange(samples_, {});
  return block;
}

std::array<double, 3> ServoRecorder::load() const {
  std::array<double, 3> percent{};
  for (std::size_t i = 0; i < 3; ++i) percent[i] = 100.0 * std::abs(current_[i]) / drives_[i].rated_current;
  return percent;
}

}  // namespace smartmill::sim
