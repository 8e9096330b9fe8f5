#pragma once

#include "smartmill_core/command.h"

namespace smartmill::hammer {

/// FRF and modes from hammer tests.
smartmill::Command frfCommand();
/// Drift of modes, friction and unbalance over recorded sessions.
smartmill::Command healthCommand();

}  // namespace smartmill::hammer
