#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// [N/m] Coefficient of the effect process_damping of a model; 0 without this effect.
/// @throws Error naming file and key when it is negative: it would drive the vibration.
double processDamping(const MachineModel& model);

/// The regenerative system of a model and an engagement [deg], with its process damping: modes of x and y of
/// the tool, then those of the workpiece. Other effects of the model are not included. @throws Error naming
/// what the model lacks, or when it states several places of the workpiece (atPosition() selects one).
RegenerativeSystem systemOf(const MachineModel& model, double entry_deg, double exit_deg);

/// Values of LO:HI:N, evenly spaced; 0 < LO < HI, or N = 1 and LO = HI. @param option named in the error
/// @throws Error on another form.
std::vector<double> rangeOf(const std::string& option, const std::string& text);

}  // namespace smartmill::stability
