#pragma once

#include "smartmill_core/command.h"

namespace smartmill::sim {

/// Command `simulate`: simulates a campaign from its model and plan.
Command simulateCommand();
/// Command `hide`: draws a machine with an effect that its model lacks.
Command hideCommand();
/// Command `controller`: runs the simulated Fanuc controller in wall-clock time.
Command controllerCommand();

}  // namespace smartmill::sim
