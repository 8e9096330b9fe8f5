#pragma once

#include <string>
#include <vector>

#include "smartmill_program/nc/program_reader.h"

namespace smartmill::program {

/// The moves of a program as LinuxCNC's own interpreter executes it: O words, named parameters, G38, all that
/// this installed version supports. Runs its program rs274 (package linuxcnc-uspace) and reads the canonical
/// commands, whose coordinates have four decimals in the unit of the program. As in interpretProgram() the
/// rapid move from an unknown position (the start, G28, G30, G53) is not part of the result.
/// @throws Error "FILE: line N: ..." with the interpreter's message; "rs274: not found ..."; on commands that
/// have no move in this model (probing, rotary axes, threads)
std::vector<Move> interpretWithLinuxcnc(const std::string& text, const std::string& name,
                                        const ReaderOptions& options = {});

}  // namespace smartmill::program
