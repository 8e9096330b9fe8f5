#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/gap/twin_runner.h"

namespace smartmill::discrepancy {

/// Orders of the spindle at which a force locked to its angle explains most of a residual, best first: the
/// same force in every record, filtered by the model's force sensor.
/// @param residual (measured - simulated) / noise, in the layout of the runner's vectors
std::vector<double> bestOrders(const TwinRunner& runner, const MachineModel& model,
                               const std::vector<double>& residual, std::size_t count);

}  // namespace smartmill::discrepancy
