#pragma once

#include <functional>
#include <string>
#include <vector>

namespace smartmill::session {

/// Runs a program found on PATH to its end. @param log file that gets all its output
/// @param stopped asked again and again; then the program gets SIGINT, and SIGKILL when it does not end
/// @return exit status, 128 + signal where one ended it. @throws Error when it cannot be started.
int runChild(
    const std::vector<std::string>& command, const std::string& log,
    const std::function<bool()>& stopped = [] { return false; });

/// The program whose subcommands are the offline tools.
constexpr const char* TOOL_PROGRAM = "smartmill";

/// A subcommand of TOOL_PROGRAM, and what the caller needs it for, in the words of an error message.
struct Tool {
  std::string subcommand, purpose;
};

/// Runs a tool to its end, as runChild().
/// @return exit status. @throws Error naming the tool and its purpose: program not found, command line
/// refused.
int runTool(
    const Tool& tool, const std::vector<std::string>& arguments, const std::string& log,
    const std::function<bool()>& stopped = [] { return false; });

}  // namespace smartmill::session
