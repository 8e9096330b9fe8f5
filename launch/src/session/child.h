#pragma once

#include <functional>
#include <string>
#include <vector>

namespace smartmill::session {

/// Runs a program found on PATH to its end. @param log file that gets all its output
/// @param stopped asked again and again; then the program gets SIGINT, and SIGKILL when it does not end
/// @return exit status, 128 + signal where one ended it. @throws Error when it cannot be started.
int runChild(const std::vector<std::string>& command, const std::string& log,
             const std::function<bool()>& stopped);

}  // namespace smartmill::session
