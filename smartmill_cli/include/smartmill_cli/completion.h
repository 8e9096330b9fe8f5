#pragma once

#include <string>

#include "smartmill_core/command.h"

namespace smartmill {

/// A bash script that completes commands, their options, values that are words, and files.
std::string bashCompletion(const CommandProgram& program);

/// `completion bash` prints the script of `program`.
Command completionCommand(const CommandProgram& program);

}  // namespace smartmill
