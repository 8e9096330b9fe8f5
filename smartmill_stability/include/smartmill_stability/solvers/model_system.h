#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// The regenerative system of a model and an engagement [deg]. @throws Error naming what the model lacks.
RegenerativeSystem systemOf(const MachineModel& model, double entry_deg, double exit_deg);

/// Values of LO:HI:N, evenly spaced; 0 < LO < HI, or N = 1 and LO = HI. @param option named in the error
/// @throws Error on another form.
std::vector<double> rangeOf(const std::string& option, const std::string& text);

}  // namespace smartmill::stability
