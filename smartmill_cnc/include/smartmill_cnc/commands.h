#pragma once

#include "smartmill_core/command.h"

namespace smartmill::cnc {

/// Records a session with a Fanuc controller.
Command captureCommand();

/// Reads an NC program from the memory of a Fanuc controller.
Command fetchProgramCommand();

}  // namespace smartmill::cnc
