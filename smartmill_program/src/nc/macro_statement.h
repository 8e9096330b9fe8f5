#pragma once

#include <optional>
#include <string>

#include "macro_variables.h"
#include "smartmill_core/nc/block_reader.h"

namespace smartmill::program {

/// A statement of Fanuc's macro B: a line without motion.
struct MacroStatement {
  enum class Kind {
    none,  ///< a block of words
    assignment,
    jump,        ///< GOTO, of an IF whose condition is true
    nothing,     ///< IF whose condition is false
    loop_begin,  ///< WHILE [...] DO, DO
    loop_end,    ///< END
    call         ///< G65
  };
  Kind kind = Kind::none;
  int number = 0;                 ///< variable, N of a jump, number of a loop, program of a call
  std::optional<double> value;    ///< of an assignment; nullopt: vacant
  bool enters = true;             ///< of a loop: its condition is true
  int repeats = 1;                ///< L of a call
  MacroVariables::Locals locals;  ///< of a call
  std::size_t column = 1;         ///< in the line, from 1
};

/// Reads and evaluates a line. @throws Error
MacroStatement readMacroStatement(const std::string& line, const MacroVariables& variables);

/// N at the beginning of a line; nullopt: none. Number of a line DO or END; 0: no such line. They do not
/// evaluate anything.
std::optional<int> sequenceOf(const std::string& line);
int loopBeginOf(const std::string& line);
int loopEndOf(const std::string& line);

}  // namespace smartmill::program
