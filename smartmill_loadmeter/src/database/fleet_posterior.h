#pragma once

#include <vector>

#include "fleet_solver.h"

namespace smartmill::loadmeter {

/// Solutions at points of the posterior of the deviations; their log_weight holds the weight itself. One
/// point with known deviations.
std::vector<FleetPoint> posteriorOf(const FleetSolver& solver, const FleetModelOptions& options);

}  // namespace smartmill::loadmeter
