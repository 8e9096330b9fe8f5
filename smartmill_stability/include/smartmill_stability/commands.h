#pragma once

#include "smartmill_core/command.h"

namespace smartmill::stability {

/// Stability lobes of a machine model.
Command lobesCommand();
/// Stability chart and chatter verdicts of a recorded session, as computed by stability_node.
Command chartCommand();
/// Probability of chatter over speed and depth.
Command chatterProbabilityCommand();
/// Coefficient of process damping from cuts with their verdicts.
Command processDampingCommand();
/// Tip FRF of a tool that was not tapped, by receptance coupling.
Command toolFrfCommand();
/// Chatter in a recorded cut.
Command detectCommand();
/// Stability chart from cuts alone.
Command lobesFromCutsCommand();
/// Next spindle speed for a chattering cut, from its sound.
Command nextSpeedCommand();

}  // namespace smartmill::stability
