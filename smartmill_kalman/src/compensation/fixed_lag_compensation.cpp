#include "smartmill_kalman/compensation/fixed_lag_compensation.h"

#include <cmath>
#include <utility>

namespace smartmill::kalman {

FixedLagCompensation::FixedLagCompensation(const CompensationParameters& parameters, ForceOutputs outputs)
    : HarmonicCompensation(parameters, std::move(outputs)), lag_(parameters.lag) {
}

double FixedLagCompensation::step(std::size_t axis, HarmonicFilter& filter, double measured) {
  return smoothers_[axis].step(filter, measured);
}

void FixedLagCompensation::publish(const ForceBlock& measured, ForceBlock&& compensated) {
  pending_.emplace_back(measured, std::move(compensated));
  const auto lag = static_cast<std::size_t>(std::lround(lag_ * measured.sample_rate));
  while (!pending_.empty() && smoothers_[0].pending() >= pending_.front().first.force[0].size() + lag)
    publishOldest();
}

void FixedLagCompensation::publishOldest() {
  auto [measured, compensated] = std::move(pending_.front());
  pending_.pop_front();
  for (std::size_t axis = 0; axis < 3; ++axis)
    compensated.force[axis] = smoothers_[axis].takeSmoothed(compensated.force[axis].size());
  outputs().publish(measured, compensated);
}

void FixedLagCompensation::flush() {
  while (!pending_.empty()) publishOldest();
}

void FixedLagCompensation::reset() {
  pending_.clear();
  smoothers_ = {};
  HarmonicCompensation::reset();
}

}  // namespace smartmill::kalman
