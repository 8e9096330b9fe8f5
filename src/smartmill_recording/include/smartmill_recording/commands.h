#pragma once

#include "smartmill_core/command.h"

namespace smartmill::recording {

/// Copies a recording into another format or compression.
Command convertCommand();

}  // namespace smartmill::recording
