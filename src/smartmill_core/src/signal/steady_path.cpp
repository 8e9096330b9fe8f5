#include "smartmill_core/signal/steady_path.h"

#include <cmath>
#include <cstddef>
#include <optional>

#include "smartmill_core/axis_names.h"

namespace smartmill {

bool onSteadyPath(const CuttingCondition& condition, const CncState& state, double tolerance) {
  double length2 = 0.0, along = 0.0, distance2 = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::optional<std::size_t> index = controllerAxis(state.axes, a);
    if (!index || *index >= state.position.size()) return false;
    const double step = condition.steady_to[a] - condition.steady_from[a];
    const double at = state.position[*index] - condition.steady_from[a];
    length2 += step * step;
    along += step * at;
    distance2 += at * at;
  }
  if (!(length2 > 0.0) || along < 0.0 || along > length2) return false;
  return distance2 - along * along / length2 <= tolerance * tolerance;
}

bool feedTurns(const CuttingCondition& condition) {
  return condition.kind == CuttingCondition::Kind::cut && std::isnan(condition.steady_to[0]);
}

bool inSteadyCut(const CuttingCondition& condition, const CncState& state, double tolerance) {
  return feedTurns(condition) ? state.feed > 0.0 : onSteadyPath(condition, state, tolerance);
}

double headingOf(const CuttingCondition& condition) {
  const auto& from = condition.steady_from;
  const auto& to = condition.steady_to;
  const std::size_t across = condition.tool.teeth == 0 ? 2 : 1;
  return std::atan2(to[across] - from[across], to[0] - from[0]);
}

}  // namespace smartmill
