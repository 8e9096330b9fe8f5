#include "smartmill_stability/chart/chart_solver.h"

#include <algorithm>
#include <limits>

#include "smartmill_stability/chart/limit_continuation.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {

StabilityLimit ChartSolver::limits(const std::vector<double>& speeds) const {
  const bool exact = method == Method::collocation;
  if (exact && speeds.size() > 1)
    return limitsByContinuation(system, speeds, max_depth, ContinuationAccuracy::ofChart());
  // The zero-order solution costs the same at any depth.
  const double deepest = exact ? max_depth : std::numeric_limits<double>::infinity();
  StabilityLimit limit;
  limit.spindle_speed = speeds;
  for (const Limit& found : makeSolver(method, system)->limits(speeds, deepest)) {
    limit.depth.push_back(found.depth);
    limit.chatter_frequency.push_back(found.frequency);
  }
  return limit;
}

double ChartSolver::absoluteDepthLimit(const StabilityLimit& chart) const {
  if (method == Method::zero_order && !system.hasProcessDamping() && !system.edge.inclined()) {
    const RegenerativeProcess process{system.teeth, system.entry, system.exit, system.kt,
                                      system.kr / system.kt};
    return stability::absoluteDepthLimit(process, *system.response);
  }
  return *std::min_element(chart.depth.begin(), chart.depth.end());
}

}  // namespace smartmill::stability
