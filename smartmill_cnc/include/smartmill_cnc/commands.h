#pragma once

#include "smartmill_core/command.h"

namespace smartmill::cnc {

/// Records a session with a Fanuc controller.
Command captureCommand();

}  // namespace smartmill::cnc
