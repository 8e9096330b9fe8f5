#pragma once

#include "smartmill_core/command.h"

namespace smartmill::recording {

/// Accounts for every message and sample of a recording.
Command accountCommand();
/// Copies a recording into another format or compression.
Command convertCommand();
/// Writes samples of a recording or campaign to a file of another program.
Command exportCommand();

}  // namespace smartmill::recording
