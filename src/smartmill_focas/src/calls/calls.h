#pragma once

#include <optional>
#include <string>

#include "call_table.h"
#include "smartmill_focas/controller_interface.h"

namespace smartmill::focas {

// The calls of each topic, added to a table that answers them; they keep references to their arguments.

void addStateCalls(StateInterface& state, const SysInfo& info, CallTable& table);
void addAxesCalls(AxesInterface& axes, const SysInfo& info, CallTable& table);
void addMacroCalls(MacroInterface& macros, CallTable& table);
void addDataCalls(DataInterface& data, const SysInfo& info, CallTable& table);
void addProgramCalls(ProgramsInterface& programs, CallTable& table);

/// All of them.
CallTable callsOf(const ControllerInterface& controller, const SysInfo& info);

/// As in the clock and in lists of programs: six u16.
void putDateTime(const DateTime& at, Writer& out);

/// O number of a program's name or path ("O1234", "//CNC_MEM/USER/PATH1/O1234", "1234"); empty: no number.
std::optional<int> programNumber(const std::string& name);

}  // namespace smartmill::focas
