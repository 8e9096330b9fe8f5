#pragma once

#include "smartmill_core/command.h"

namespace smartmill::sim {

/// Simulates a campaign from its model and plan.
Command simulateCommand();
/// Draws a machine that has an effect its model lacks.
Command hideCommand();
/// The simulated Fanuc controller, in wall-clock time.
Command controllerCommand();

}  // namespace smartmill::sim
