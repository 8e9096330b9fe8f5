#pragma once

#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "smartmill_core/error.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace smartmill {

/// A command line that a program refuses after it was parsed.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// Options and arguments of a program, or of one of its commands; by CLI11, whose header takes 4 s of compile
/// time.
class CommandOptions {
 public:
  /// One of them, with what it must fulfil.
  class Option {
   public:
    explicit Option(CLI::Option* option) : option_(option) {}
    const Option& required() const;
    const Option& showDefault() const;  ///< the value's present content, in --help
    const Option& within(double low, double high) const;
    const Option& positive() const;
    const Option& notNegative() const;
    const Option& oneOf(const std::vector<std::string>& words) const;
    const Option& existingFile() const;
    const Option& count(int least, int most) const;  ///< of a list's entries
    const Option& commas() const;                    ///< a list's entries may stand between commas
    const Option& needs(const Option& other) const;
    const Option& excludes(const Option& other) const;

   private:
    CLI::Option* option_;
  };

  explicit CommandOptions(CLI::App* app) : app_(app) {}

  /// @param name "-o,--out" or, for an argument by its place, "MODEL". @param value keeps its content where
  /// it is not given: std::string, double, int, unsigned, std::uint64_t, or a std::vector of strings or
  /// numbers.
  template <typename T>
  Option option(const std::string& name, T& value, const std::string& help = "") const;
  /// @param name "--errors", or "!--no-pictures" for one that makes the value false
  Option flag(const std::string& name, bool& value, const std::string& help = "") const;
  /// This command was given.
  bool parsed() const;

 protected:
  CLI::App* app_;
};

class CommandLine : public CommandOptions {
 public:
  explicit CommandLine(const std::string& description = "");
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;
  ~CommandLine();

  /// A command with options of its own; one of them is due.
  CommandOptions command(const std::string& name, const std::string& help);
  /// Behind the options in --help.
  void footer(const std::string& text);
  std::string help() const;

  struct Stop {
    bool stop = false;  ///< the complaint or the help has been printed, the program is to end
    int code = 0;       ///< with this exit code
  };
  Stop parse(int argc, const char* const* argv);

 private:
  std::unique_ptr<CLI::App> root_;
};

/// Body of a command-line program's main: parses the command line, then runs. @return the exit code: what
/// `run` returns; 1 after an exception, said in one line "PROGRAM: what" on standard error; 2 for a refused
/// command line.
int runProgram(CommandLine& line, int argc, const char* const* argv, const std::function<int()>& run);

/// The same for a `run` that returns nothing: 0 when it ends.
template <typename Run, typename = std::enable_if_t<std::is_void_v<std::invoke_result_t<Run>>>>
int runProgram(CommandLine& line, int argc, const char* const* argv, const Run& run) {
  return runProgram(line, argc, argv, std::function<int()>([&run] {
                      run();
                      return 0;
                    }));
}

}  // namespace smartmill
