#include "smartmill_discrepancy/fit/member_tangents.h"

#include <utility>

namespace smartmill::discrepancy {

SparseColumns memberTangents(const Fitter& fitter, const FitState& state,
                             const std::vector<std::size_t>& members, SimulatedChannels* base) {
  std::vector<MachineModel> models{fitter.model(state)};
  std::vector<double> steps;
  for (const std::size_t m : members) {
    const std::vector<Coordinate>& coordinates = state.members[m].hypothesis->coordinates;
    for (std::size_t c = 0; c < coordinates.size(); ++c) {
      FitState moved = state;
      double& value = moved.members[m].values[c];
      const double step =
          value + coordinates[c].step > coordinates[c].high ? -coordinates[c].step : coordinates[c].step;
      value += step;
      steps.push_back(step);
      models.push_back(fitter.model(moved));
    }
  }
  auto simulated = fitter.runner().simulateChannels(models);
  *base = std::move(simulated.front());
  simulated.erase(simulated.begin());
  return {fitter.runner(), *base, simulated, steps};
}

}  // namespace smartmill::discrepancy
