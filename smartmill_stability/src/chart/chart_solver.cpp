#include "smartmill_stability/chart/chart_solver.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

namespace smartmill::stability {
namespace {

/// Limits at ascending speeds: solved by bisection until linear interpolation between the neighbours is
/// right, then interpolated.
StabilityLimit refinedLimits(const StabilitySolver& solver, const std::vector<double>& speeds,
                             double max_depth) {
  constexpr std::size_t STRIDE = 16;  // speeds between two that are solved in any case
  constexpr double STRAIGHT = 3e-3;   // [1] error of the interpolation
  StabilityLimit limit;
  limit.spindle_speed = speeds;
  limit.depth.assign(speeds.size(), std::numeric_limits<double>::infinity());
  limit.chatter_frequency.assign(speeds.size(), std::numeric_limits<double>::quiet_NaN());
  const auto solve = [&](std::size_t i) {
    const Limit found = solver.limit(speeds[i], max_depth);
    limit.depth[i] = found.depth;
    limit.chatter_frequency[i] = found.frequency;
  };
  const auto between = [&](std::size_t a, std::size_t b, std::size_t i, const std::vector<double>& values) {
    const double share = (speeds[i] - speeds[a]) / (speeds[b] - speeds[a]);
    return values[a] + share * (values[b] - values[a]);
  };
  const std::function<void(std::size_t, std::size_t)> fill = [&](std::size_t a, std::size_t b) {
    if (b - a < 2) return;
    const std::size_t middle = (a + b) / 2;
    solve(middle);
    const double expected = between(a, b, middle, limit.depth);
    const double frequency = between(a, b, middle, limit.chatter_frequency);
    const bool all_stable =
        std::isinf(limit.depth[a]) && std::isinf(limit.depth[b]) && std::isinf(limit.depth[middle]);
    const bool straight = std::abs(limit.depth[middle] - expected) <= STRAIGHT * expected &&
                          std::abs(limit.chatter_frequency[middle] - frequency) <= STRAIGHT * frequency;
    if (!all_stable && !(straight && std::isfinite(expected))) {
      fill(a, middle);
      fill(middle, b);
      return;
    }
    if (all_stable) return;
    for (const auto& [from, to] : {std::pair{a, middle}, {middle, b}}) {
      for (std::size_t i = from + 1; i < to; ++i) {
        limit.depth[i] = between(from, to, i, limit.depth);
        limit.chatter_frequency[i] = between(from, to, i, limit.chatter_frequency);
      }
    }
  };
  solve(0);
  for (std::size_t a = 0; a + 1 < speeds.size();) {
    const std::size_t b = std::min(a + STRIDE, speeds.size() - 1);
    solve(b);
    fill(a, b);
    a = b;
  }
  return limit;
}

}  // namespace

StabilityLimit ChartSolver::limits(const std::vector<double>& speeds) const {
  return solver ? refinedLimits(*solver, speeds, max_depth) : zeroOrderLimit(process, response, speeds);
}

}  // namespace smartmill::stability
