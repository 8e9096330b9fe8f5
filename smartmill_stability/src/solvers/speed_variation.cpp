#include "smartmill_core/cutting/speed_variation.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/delayed_system.h"

// The angle over the mean speed is a time in which a system of varied speed has the feedback and the delays
// of the mean speed: regeneration and tooth passing depend on the angle alone.

namespace smartmill::stability {
namespace {

using units::TWO_PI;

constexpr int MOST_VARIATIONS = 20;  // in a principal period
constexpr double WHOLE = 1e-6;       // [1] rounding of a stated ratio

/// Variations until the teeth are where they were at the start. @param passes tooth passings (or revolutions)
/// in one variation
int variationsOf(const SpeedVariation& variation, double passes) {
  for (int n = 1; n <= MOST_VARIATIONS; ++n) {
    if (std::round(n * passes) >= 1.0 && std::abs(std::remainder(n * passes, 1.0)) < WHOLE * n * passes)
      return n;
  }
  throw Error(
      formatted("ratio of the speed variation %g: expected a ratio at which up to %d variations last a "
                "whole number of tooth passings (of revolutions if the pitch is uneven)",
                variation.ratio, MOST_VARIATIONS));
}

}  // namespace

DelayedSystem withSpeedVariation(const DelayedSystem& mean, const SpeedVariation& variation, double speed) {
  variation.validate();
  const double passes = TWO_PI / (variation.ratio * speed * mean.period);
  const int variations = variationsOf(variation, passes);
  const auto whole = static_cast<long>(std::lround(variations * passes));
  // Time at the mean speed that gives the angle at t, and the reverse.
  const auto at_mean = [variation, speed](double t) { return variation.angle(speed * t) / speed; };
  const auto time = [variation, speed](double at) { return variation.turn(speed * at) / speed; };
  DelayedSystem varied = mean;
  varied.period = static_cast<double>(whole) * mean.period;
  for (double& delay : varied.delays) delay /= 1.0 + variation.amplitude;
  varied.breaks.clear();
  for (long k = 0; k < whole; ++k) {
    for (const double at : mean.breaks) {
      const double t = time(at + static_cast<double>(k) * mean.period);
      if (t < varied.period) varied.breaks.push_back(t);
    }
  }
  // Corners of the speed.
  for (int k = 0; k < 2 * variations && variation.shape == SpeedVariation::Shape::triangle; ++k)
    varied.breaks.push_back((k + 0.5) * units::PI / (variation.ratio * speed));
  varied.rate = mean.rate * (1.0 + variation.amplitude);
  varied.delay = [at_mean, time, delays = mean.delays](std::size_t k, double t) {
    return t - time(at_mean(t) - delays[k]);
  };
  varied.feedback = [at_mean, variation, speed, feedback = mean.feedback](double t, double inside,
                                                                          Feedback& result) {
    feedback(at_mean(t), at_mean(inside), result);
    // The force of the flank is inverse to the cutting speed.
    result.velocity /= variation.speed(speed * t);
  };
  return varied;
}

}  // namespace smartmill::stability
