#pragma once

#include "smartmill_core/command.h"

namespace smartmill::program {

/// Engagement, forces and stability of every block of an NC program.
Command programCommand();

}  // namespace smartmill::program
