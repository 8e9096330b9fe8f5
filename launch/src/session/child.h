#pragma once

#include <functional>
#include <string>
#include <vector>

namespace smartmill::session {

// By hand: Boost.Process would save 12 lines, but needs the library boost_filesystem.

/// Runs a program on PATH to its end. @param log file for all its output
/// @param stopped polled; once it returns true, the program gets SIGINT, and SIGKILL if it does not end
/// @return exit code, 128 + signal if a signal ended it. @throws Error if it cannot be started.
int runChild(
    const std::vector<std::string>& command, const std::string& log,
    const std::function<bool()>& stopped = [] { return false; });

/// The program whose subcommands are the offline tools.
constexpr const char* TOOL_PROGRAM = "smartmill";

/// A subcommand of TOOL_PROGRAM and its purpose for the caller, for error messages.
struct Tool {
  std::string subcommand, purpose;
};

/// Runs a tool to its end, as runChild().
/// @return exit code. @throws Error naming the tool and its purpose if the program is not found or refuses
/// the command line.
int runTool(
    const Tool& tool, const std::vector<std::string>& arguments, const std::string& log,
    const std::function<bool()>& stopped = [] { return false; });

}  // namespace smartmill::session
