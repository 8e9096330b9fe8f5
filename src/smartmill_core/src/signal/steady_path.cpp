#include "smartmill_core/signal/steady_path.h"

#include <algorithm>

namespace smartmill {

bool onSteadyPath(const CuttingCondition& condition, const CncState& state, double tolerance) {
  const std::array<const char*, 3> names{"X", "Y", "Z"};
  double length2 = 0.0, along = 0.0, distance2 = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto axis = std::find(state.axes.begin(), state.axes.end(), names[a]);
    const auto index = static_cast<std::size_t>(axis - state.axes.begin());
    if (index >= state.position.size()) return false;
    const double step = condition.steady_to[a] - condition.steady_from[a];
    const double at = state.position[index] - condition.steady_from[a];
    length2 += step * step;
    along += step * at;
    distance2 += at * at;
  }
  if (!(length2 > 0.0) || along < 0.0 || along > length2) return false;
  return distance2 - along * along / length2 <= tolerance * tolerance;
}

}  // namespace smartmill
