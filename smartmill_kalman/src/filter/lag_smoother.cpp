#include "smartmill_kalman/filter/lag_smoother.h"

#include <algorithm>
#include <cmath>

namespace smartmill::kalman {
namespace {

/// Length of the filter's window plus the samples that a change needs to show through the sensor.
constexpr std::size_t BACK = InnovationWatch::WINDOW + 8;

}  // namespace

double LagSmoother::step(HarmonicFilter& filter, double measured) {
  Sample sample;
  sample.level = filter.level();
  sample.seen = std::isfinite(measured);
  sample.wall = false;
  sample.layout = filter.layout();
  const double force = sample.seen ? filter.step(measured) : filter.coast();
  sample.innovation = filter.innovation();
  sample.predicted = force - sample.layout->force_gain[sample.level] * sample.innovation;
  if (samples_.empty()) restarts_ = filter.restarts();
  samples_.push_back(std::move(sample));
  if (filter.restarts() != restarts_) {
    restarts_ = filter.restarts();
    samples_[samples_.size() - std::min(BACK, samples_.size())].wall = true;
  }
  return force;
}

std::vector<double> LagSmoother::take(std::size_t count) {
  count = std::min(count, samples_.size());
  std::vector<double> force(count);
  std::vector<HarmonicFilter::GainBlock> lambda;
  for (std::size_t at = samples_.size(); at-- > 0;) {
    const Sample& sample = samples_[at];
    if (lambda.size() != sample.layout->blocks.size())
      lambda.assign(sample.layout->blocks.size(), HarmonicFilter::GainBlock{});
    const double correction =
        HarmonicFilter::goBack(*sample.layout, sample.level, sample.innovation, sample.seen, lambda);
    if (at < count) force[at] = sample.predicted + correction;
    if (sample.wall) std::fill(lambda.begin(), lambda.end(), HarmonicFilter::GainBlock{});
  }
  samples_.erase(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(count));
  return force;
}

}  // namespace smartmill::kalman
