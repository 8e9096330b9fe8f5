#include "smartmill_kalman/filter/fixed_lag_smoother.h"

#include <algorithm>
#include <cmath>

namespace smartmill::kalman {
double FixedLagSmoother::step(HarmonicFilter& filter, double measured) {
  filter.setWeighting(false);
  Sample sample;
  sample.level = filter.memory().level();
  sample.is_measured = std::isfinite(measured);
  sample.design = filter.smoother();
  const double force = sample.is_measured ? filter.step(measured) : filter.predict();
  sample.innovation = filter.innovation();
  sample.predicted = force - sample.design->force_gain[sample.level] * sample.innovation;
  if (samples_.empty()) restarts_ = filter.memory().restarts();
  samples_.push_back(std::move(sample));
  if (filter.memory().restarts() != restarts_) {
    restarts_ = filter.memory().restarts();
    samples_[samples_.size() - std::min(AdaptiveMemory::DETECTION_DELAY, samples_.size())].is_change = true;
  }
  return force;
}

std::vector<double> FixedLagSmoother::takeSmoothed(std::size_t count) {
  count = std::min(count, samples_.size());
  std::vector<double> force(count);
  std::vector<HarmonicPairs::GainBatch> lambda;
  for (std::size_t at = samples_.size(); at-- > 0;) {
    const Sample& sample = samples_[at];
    if (lambda.size() != sample.design->batches.size())
      lambda.assign(sample.design->batches.size(), HarmonicPairs::GainBatch{});
    const double correction =
        sample.design->backward(sample.level, sample.innovation, sample.is_measured, lambda);
    if (at < count) force[at] = sample.predicted + correction;
    if (sample.is_change) std::fill(lambda.begin(), lambda.end(), HarmonicPairs::GainBatch{});
  }
  samples_.erase(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(count));
  return force;
}

}  // namespace smartmill::kalman
