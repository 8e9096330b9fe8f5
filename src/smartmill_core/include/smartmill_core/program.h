#pragma once

#include <functional>
#include <type_traits>

namespace CLI {
class App;
}

namespace smartmill {

/// Body of a command-line program's main: parses the command line, then runs. @return the exit code: what
/// `run` returns; 1 after an exception, said in one line "PROGRAM: what" on standard error; 2 for a refused
/// command line.
int runProgram(CLI::App& app, int argc, const char* const* argv, const std::function<int()>& run);

/// The same for a `run` that returns nothing: 0 when it ends.
template <typename Run, typename = std::enable_if_t<std::is_void_v<std::invoke_result_t<Run>>>>
int runProgram(CLI::App& app, int argc, const char* const* argv, const Run& run) {
  return runProgram(app, argc, argv, std::function<int()>([&run] {
                      run();
                      return 0;
                    }));
}

}  // namespace smartmill
