#include "hit_channel.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill {
namespace {

struct Background {
  double level = 0.0, noise = 0.0, scatter = 0.0;
};

/// Baseline and noise before the hit, or at the record's end where it begins with the hit.
Background backgroundOf(const std::vector<double>& values, std::size_t before) {
  const std::size_t n = before - before / 4;
  const auto first = values.begin();
  const std::vector<double> part =
      n >= LEAST_QUIET_SAMPLES
          ? std::vector<double>(first, first + static_cast<std::ptrdiff_t>(n))
          : std::vector<double>(values.end() - static_cast<std::ptrdiff_t>(values.size() / 10), values.end());
  if (part.size() < 2) return {};
  return {mean(part), noiseUnderRinging(part), standardDeviation(part)};
}

}  // namespace

HitChannel hitChannel(const std::vector<double>& values, std::size_t before) {
  const Background background = backgroundOf(values, before);
  // Where the record begins with the hit and still rings at its end, the mean there is not a baseline.
  const bool rings = before - before / 4 < LEAST_QUIET_SAMPLES && background.scatter > 3.0 * background.noise;
  HitChannel c{values, background.noise, 0.0};
  for (double& v : c.values) {
    v -= rings ? 0.0 : background.level;
    c.largest = std::max(c.largest, std::abs(v));
  }
  return c;
}

std::size_t contactEnd(const HitChannel& force) {
  const auto top = static_cast<std::size_t>(std::max_element(force.values.begin(), force.values.end()) -
                                            force.values.begin());
  const double touch = std::max(0.02 * force.largest, 4.0 * force.noise);
  std::size_t end = top;
  while (end + 1 < force.values.size() && force.values[end] > touch) ++end;
  return end;
}

}  // namespace smartmill
