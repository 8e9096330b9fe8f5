#pragma once

#include "smartmill_core/command.h"

namespace smartmill::stability {

/// Stability lobes of a machine model.
Command lobesCommand();
/// The stability chart that stability_node makes of a recorded session.
Command chartCommand();
/// Probability of chatter over speed and depth.
Command chatterProbabilityCommand();
/// Chatter in a recorded cut.
Command detectCommand();

}  // namespace smartmill::stability
