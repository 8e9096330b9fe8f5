#include "chart/limit_search.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

/// Dominant multiplier at a depth.
struct Sample {
  double depth = 0.0, log_radius = 0.0;
  CharacteristicMultiplier multiplier;
};

Sample sampleOf(FloquetSolver::AtSpeed& here, double depth) {
  Sample sample{depth, 0.0, here.multiplier(depth)};
  sample.log_radius = std::log(std::max(1e-300, sample.multiplier.radius()));
  return sample;
}

double slopeOf(const Sample& a, const Sample& b) {
  return (b.log_radius - a.log_radius) / std::log(b.depth / a.depth);
}

/// The limit from a sample close to it.
LimitKnot knotAt(FloquetSolver::AtSpeed& here, const Sample& sample, double slope, double frequency,
                 double tolerance) {
  LimitKnot knot;
  knot.solved = true;
  knot.slope = slope;
  knot.kind = sample.multiplier.kind();
  knot.depth = sample.depth * std::exp(-sample.log_radius / slope);
  // The motion contains the frequency of the multiplier plus all multiples of that of the period.
  const double step = 1.0 / sample.multiplier.period;
  const double base = std::abs(std::arg(sample.multiplier.value)) / units::TWO_PI * step;
  for (const double sign : {1.0, -1.0}) {
    const double nearest = sign * base + step * std::round((frequency - sign * base) / step);
    if (isClose(nearest, frequency, CONTINUATION.same_lobe) &&
        !(std::abs(knot.frequency - frequency) < std::abs(nearest - frequency)))
      knot.frequency = nearest;
  }
  if (std::isnan(knot.frequency)) knot.frequency = here.chatterFrequency((1.0 + tolerance) * knot.depth);
  return knot;
}

/// Limit between a stable and an unstable depth. @param frequency [Hz] expected; not finite: unknown
LimitKnot refined(FloquetSolver::AtSpeed& here, Sample low, Sample high, double frequency, double tolerance) {
  constexpr int MOST = 12;
  for (int k = 0; k < MOST && high.depth > (1.0 + tolerance) * low.depth; ++k) {
    const double share = -low.log_radius / (high.log_radius - low.log_radius);
    const Sample middle =
        sampleOf(here, low.depth * std::pow(high.depth / low.depth, std::clamp(share, 0.03, 0.97)));
    const double off = std::abs(middle.log_radius / slopeOf(low, high));
    (middle.log_radius > 0.0 ? high : low) = middle;
    if (off < tolerance) return knotAt(here, middle, slopeOf(low, high), frequency, tolerance);
  }
  return knotAt(here, high, slopeOf(low, high), frequency, tolerance);
}

}  // namespace

LimitKnot LimitSearch::fromZero(double speed) const {
  const auto here = solver_.at(speed);
  constexpr int MOST = 8;
  Sample low = sampleOf(*here, start_), high = low;
  for (int k = 0; k < MOST && low.log_radius > 0.0; ++k) {
    high = low;
    low = sampleOf(*here, 0.5 * low.depth);
  }
  double slope = 0.0;
  while (high.log_radius <= 0.0 && low.depth < max_depth_) {
    constexpr double OVERSHOOT = 1.2, LEAST = 1.04;
    const double predicted =
        slope > 0.0 ? std::exp(-OVERSHOOT * low.log_radius / slope) : CONTINUATION.growth;
    high =
        sampleOf(*here, std::min(max_depth_, low.depth * std::clamp(predicted, LEAST, CONTINUATION.growth)));
    slope = slopeOf(low, high);
    if (high.log_radius <= 0.0) low = high;
  }
  return high.log_radius > 0.0 ? refined(*here, low, high, LimitKnot::NO_LIMIT, tolerance_) : LimitKnot();
}

std::optional<LimitKnot> LimitSearch::near(double speed, const LimitKnot& guess) const {
  constexpr int MOST = 5;
  constexpr double NEAR = 0.003, FAR = 0.2, REACH = 1.4;
  if (!(guess.depth > 0.0) || guess.depth > max_depth_) return {};
  const auto here = solver_.at(speed);
  const Sample first = sampleOf(*here, guess.depth);
  double slope = std::max(CONTINUATION.least_slope, guess.slope);
  if (std::abs(first.log_radius) <= NEAR * slope)
    return knotAt(*here, first, slope, guess.frequency, tolerance_);
  const double step = std::exp(std::clamp(-first.log_radius / slope, -FAR, FAR));
  const Sample second = sampleOf(*here, std::min(max_depth_, step * guess.depth));
  slope = slopeOf(first, second);
  // The error of the secant grows with the rest of the way and with the length of the secant.
  const double rest = std::abs(second.log_radius / slope);
  if (slope > CONTINUATION.least_slope && rest * std::max(rest, std::abs(step - 1.0)) <= tolerance_)
    return knotAt(*here, second, slope, guess.frequency, tolerance_);
  Sample low = first.depth < second.depth ? first : second,
         high = first.depth < second.depth ? second : first;
  double reach = 1.05;
  for (int k = 0; k < MOST && low.log_radius > 0.0; ++k, reach = std::min(reach * reach, REACH)) {
    high = low;
    low = sampleOf(*here, low.depth / reach);
  }
  for (int k = 0; k < MOST && high.log_radius <= 0.0; ++k, reach = std::min(reach * reach, REACH)) {
    if (high.depth >= max_depth_) return {};
    low = high;
    high = sampleOf(*here, std::min(max_depth_, reach * high.depth));
  }
  if (low.log_radius > 0.0 || high.log_radius <= 0.0) return {};
  return refined(*here, low, high, guess.frequency, tolerance_);
}

bool LimitSearch::isStableTo(double speed, double depth) const {
  const auto here = solver_.at(speed);
  for (const double share : {1.0, 0.75, 0.5})
    if (sampleOf(*here, share * depth).log_radius > 0.0) return false;
  return true;
}

}  // namespace smartmill::stability
