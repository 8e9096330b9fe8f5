#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Limits at each speed [rad/s] of a model at one place of its workpiece.
using LimitsAt = std::function<std::vector<Limit>(const MachineModel& there)>;

/// Writes and draws the limits over positions along a vibrating workpiece, and prints where the least one
/// lies. @param file CSV @return the least limit over the positions at each speed
/// @throws Error when the model states less than two places.
std::vector<Limit> writePartLimits(const std::string& file, double max_depth_mm, const MachineModel& model,
                                   const std::vector<double>& speeds, const LimitsAt& limits);

}  // namespace smartmill::stability
