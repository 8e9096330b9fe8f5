#pragma once

#include "smartmill_core/command.h"

namespace smartmill {

/// The program `smartmill` with the commands of all packages.
CommandProgram smartmillProgram();

}  // namespace smartmill
