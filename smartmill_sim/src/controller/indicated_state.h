#pragma once

#include <string>

#include "controller/machine.h"

namespace smartmill::sim {

// What the machine shows on its screen and to its PMC.

focas::Status statusOf(const ControlledMachine& machine);
/// The running program from the present block on, or the selected one.
std::string programTextOf(const ControlledMachine& machine);
PmcSignals signalsOf(const ControlledMachine& machine);
double spindleLoadOf(const ControlledMachine& machine);  ///< [percent] rounded to the controller's resolution

}  // namespace smartmill::sim
