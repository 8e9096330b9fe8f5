#pragma once

#include <map>
#include <string>

#include "smartmill_core/command.h"

namespace smartmill {

/// Manual pages in man(7) macros by file name: NAME.1 and NAME-COMMAND.1 for every command.
std::map<std::string, std::string> manualPages(const CommandProgram& program);

/// The commands with their summaries as tables of Markdown, one for each topic.
std::string commandTables(const CommandProgram& program);

/// `manual -o DIR` writes the pages of `program`.
Command manualCommand(const CommandProgram& program);

}  // namespace smartmill
