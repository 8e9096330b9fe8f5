#include "smartmill_kalman/compensation/delay_compensation.h"

#include <cmath>
#include <utility>

#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/innovation_statistics.h"

namespace smartmill::kalman {
DelayCompensation::DelayCompensation(const CompensationParameters& parameters, ForceOutputs outputs)
    : parameters_(parameters), outputs_(std::move(outputs)) {
}

void DelayCompensation::setSensor(std::size_t axis, const SensorAxis& sensor) {
  stop();
  sensor_.at(axis) = sensor;
  designs_.clear();
}

bool DelayCompensation::prepare(const SpindleAngle& spindle, double sample_rate) {
  const bool at_rest = filters_.empty();
  speed_ = spindle.speed;
  const double half_samples = 2.0 * units::TWO_PI / speed_ * sample_rate;
  if (at_rest || sample_rate_ != sample_rate ||
      std::abs(half_samples - half_samples_) > parameters_.delay_hysteresis) {
    design(static_cast<int>(std::lround(half_samples)), sample_rate);
  } else if (std::abs(speed_ / filters_.front().spindleSpeed() - 1.0) > parameters_.retune_tolerance) {
    for (DelayFilter& filter : filters_) filter.retune(speed_);
  }
  return at_rest;
}

void DelayCompensation::design(int half_samples, double sample_rate) {
  const bool same_rate = sample_rate_ == sample_rate;
  if (!same_rate) designs_.clear();
  std::vector<DelayFilter> before;
  before.swap(filters_);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    auto found = designs_.find({axis, half_samples});
    if (found == designs_.end()) {
      HarmonicFilterParameters parameters = parameters_.filter;
      parameters.noise_rms = sensor_[axis].noise_rms;
      const DelayFilter designed(sensor_[axis].model, 2.0 * units::TWO_PI * sample_rate / half_samples,
                                 sample_rate, parameters);
      found = designs_.emplace(std::pair(axis, half_samples), designed).first;
    }
    filters_.push_back(found->second);
    filters_[axis].retune(speed_);
    if (!before.empty() && same_rate) filters_[axis].continueFrom(before[axis]);
  }
  half_samples_ = half_samples;
  sample_rate_ = sample_rate;
}

void DelayCompensation::process(const ForceBlock& measured, ForceBlock compensated,
                                CompensationHealth& health) {
  InnovationStatistics innovations;
  health.speed = filters_.front().spindleSpeed();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    DelayFilter& filter = filters_[axis];
    for (double& sample : compensated.force[axis]) {
      sample = std::isfinite(sample) ? filter.step(sample) : filter.predict();
      innovations.add(axis, filter);
    }
  }
  innovations.report(measured.force[0].size(), health);
  outputs_.publish(measured, compensated);
}

}  // namespace smartmill::kalman
