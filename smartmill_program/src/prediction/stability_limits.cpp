#include "smartmill_program/prediction/stability_limits.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::program {

double StabilityLimits::limit(const EngagementCell& cell, double speed) {
  const int rpm = std::max(1, static_cast<int>(std::lround(units::rpmFromRadPerSec(speed))));
  const auto [place, is_new] = limits_.try_emplace({cell, rpm}, 0.0);
  if (!is_new) return place->second;
  const auto solver = stability::makeSolver(stability::Method::collocation, cell.system(model_),
                                            stability::SolverOptions::ofManyPoints());
  const double most = MOST_DEPTH * model_.tool->radius();
  place->second = std::min(most, solver->limit(units::radPerSecFromRpm(rpm), most).depth);
  return place->second;
}

}  // namespace smartmill::program
