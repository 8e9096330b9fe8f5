#pragma once

#include "smartmill_core/command.h"

namespace smartmill::cnc {

/// A recorded session with a Fanuc controller.
Command captureCommand();

}  // namespace smartmill::cnc
