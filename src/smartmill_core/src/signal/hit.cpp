#include "smartmill_core/signal/hit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"

namespace smartmill {
namespace {

/// Equal readings in a row at the top of a noisy signal that mean clipping.
constexpr std::size_t CLIPPED_RUN = 3;
/// Samples before the hit that give a baseline worth having.
constexpr std::size_t LEAST_QUIET = 48;

std::string text(const char* format, double a, double b) {
  char line[160];
  std::snprintf(line, sizeof line, format, a, b);
  return line;
}

std::size_t runAtMaximum(const std::vector<double>& values) {
  const double top = *std::max_element(values.begin(), values.end());
  std::size_t longest = 0, run = 0;
  for (const double v : values) {
    run = v == top ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest;
}

}  // namespace

HitFault hitFault(const Hit& hit, const HitLimits& limits) {
  if (hit.force.empty() || hit.force.size() != hit.response.size()) {
    return {"the record is empty or its channels differ in length", true};
  }
  const std::size_t bad = std::min(firstNotFinite(hit.force), firstNotFinite(hit.response));
  if (bad < hit.force.size()) {
    return {"sample " + std::to_string(bad) + " is not a number", true};
  }
  const double peak = *std::max_element(hit.force.begin(), hit.force.end());
  if (peak < limits.weak_force) {
    return {text("weak hit: peak %.1f N, %.1f N are due", peak, limits.weak_force), false};
  }
  if (runAtMaximum(hit.force) >= CLIPPED_RUN)
    return {text("the force is clipped at %.1f N", peak, 0.0), true};
  if (limits.response_range > 0.0) {
    for (const double v : hit.response) {
      if (std::abs(v) >= limits.response_range) {
        return {text("the response is clipped: %.3f reaches the range %.3f", v, limits.response_range), true};
      }
    }
  }
  std::vector<double> force = hit.force;
  if (hit.pre_trigger >= LEAST_QUIET) {
    const double base = mean({force.begin(), force.begin() + static_cast<std::ptrdiff_t>(hit.pre_trigger)});
    for (double& f : force) f -= base;
  }
  if (hasSecondHit(force, limits.second_hit_share)) {
    return {text("double hit: beside the main peak of %.1f N another one above %.1f N", peak,
                 limits.second_hit_share * peak),
            false};
  }
  return {};
}

}  // namespace smartmill
