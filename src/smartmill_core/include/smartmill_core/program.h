#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "smartmill_core/error.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace smartmill {

/// A command line that is rejected after parsing.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// An option or an argument, for completion scripts and manual pages.
struct OptionEntry {
  std::vector<std::string> names;   ///< "-o", "--out"; for an argument its name only, e.g. "MODEL"
  std::string help, initial;        ///< initial: the default in --help, or empty
  std::string value;                ///< TEXT, FLOAT, INT or UINT; empty for a flag
  std::string allowed;              ///< values, e.g. "1 to 64"; empty: any
  std::vector<std::string> choice;  ///< the allowed words, if any
  bool argument = false;            ///< positional
  bool required = false;
  bool several = false;  ///< accepts several values
};

/// A command line, or one of its commands.
struct CommandEntry {
  std::string name, help;
  std::vector<OptionEntry> options;
  std::vector<CommandEntry> commands;
};

/// Options and arguments of a program or of one of its commands. Hides CLI11, whose header takes 4 s to
/// compile.
class CommandOptions {
 public:
  /// Allowed values of an option, which CLI11 does not return.
  struct Allowed {
    std::string text;
    std::vector<std::string> choice;
  };
  using AllowedValues = std::map<const CLI::Option*, Allowed>;

  /// One option, with its constraints.
  class Option {
   public:
    Option(CLI::Option* option, AllowedValues* allowed) : option_(option), allowed_(allowed) {}
    const Option& required() const;
    const Option& showDefault() const;  ///< present value as the default in --help
    const Option& within(double low, double high) const;
    const Option& positive() const;
    const Option& notNegative() const;
    const Option& oneOf(const std::vector<std::string>& words) const;
    const Option& existingFile() const;
    const Option& count(int least, int most) const;  ///< number of a list's entries
    const Option& commas() const;                    ///< list entries may be separated by commas
    const Option& needs(const Option& other) const;
    const Option& excludes(const Option& other) const;

   private:
    const Option& number(const std::string& allowed, const std::function<bool(double)>& good) const;

    CLI::Option* option_;
    AllowedValues* allowed_;
  };

  CommandOptions(CLI::App* app, std::shared_ptr<AllowedValues> allowed)
      : app_(app), allowed_(std::move(allowed)) {}

  /// @param name "-o,--out", or "MODEL" for a positional argument. @param value keeps its content when the
  /// option is absent: std::string, double, int, unsigned, std::uint64_t, or a std::vector of strings or
  /// numbers.
  template <typename T>
  Option option(const std::string& name, T& value, const std::string& help = "") const;
  /// @param name "--errors", or "!--no-pictures" for a flag that sets the value to false
  Option flag(const std::string& name, bool& value, const std::string& help = "") const;
  /// Whether this command was given.
  bool parsed() const;

 protected:
  CLI::App* app_;
  std::shared_ptr<AllowedValues> allowed_;
};

class CommandLine : public CommandOptions {
 public:
  /// @param program name in messages and --help; empty: the name by which it was started
  explicit CommandLine(const std::string& description = "", const std::string& program = "");
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;
  ~CommandLine();

  /// Adds a command with its own options; one command must be given.
  CommandOptions command(const std::string& name, const std::string& help);
  /// Sets the text after the options in --help.
  void footer(const std::string& text);
  std::string footer() const;
  std::string help() const;
  /// The name in messages; if not given to the constructor, available after parsing.
  const std::string& program() const { return program_; }
  CommandEntry entry() const;
  /// @param action runs after parsing and before the body; runProgram() reports its errors like the body's
  void afterParsing(std::function<void()> action) { after_parsing_.push_back(std::move(action)); }
  void runAfterParsing() const;

  struct Stop {
    bool stop = false;  ///< error or help has been printed, and the program must end
    int code = 0;       ///< with this exit code
  };
  Stop parse(int argc, const char* const* argv);

 private:
  std::unique_ptr<CLI::App> root_;
  std::string program_;
  std::vector<std::function<void()>> after_parsing_;
};

/// Body of a command-line program's main: parses the command line, then runs. @return the exit code: what
/// `run` returns; 1 after an exception, reported in one line "PROGRAM: what" on standard error; 2 for a
/// rejected command line, reported in the same way.
int runProgram(CommandLine& line, int argc, const char* const* argv, const std::function<int()>& run);

/// The same for a `run` without a result: returns 0.
template <typename Run, typename = std::enable_if_t<std::is_void_v<std::invoke_result_t<Run>>>>
int runProgram(CommandLine& line, int argc, const char* const* argv, const Run& run) {
  return runProgram(line, argc, argv, std::function<int()>([&run] {
                      run();
                      return 0;
                    }));
}

}  // namespace smartmill
