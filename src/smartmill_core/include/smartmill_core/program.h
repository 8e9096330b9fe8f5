#pragma once

#include <functional>
#include <map>
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

/// An option or an argument as completion scripts and manual pages show it.
struct OptionEntry {
  std::vector<std::string> names;   ///< "-o", "--out"; the place's name alone, e.g. "MODEL", of an argument
  std::string help, initial;        ///< initial: the default that --help shows, or empty
  std::string value;                ///< TEXT, FLOAT, INT or UINT; empty for a flag
  std::string allowed;              ///< values, e.g. "1 to 64"; empty: any
  std::vector<std::string> choice;  ///< the values, where they are words
  bool argument = false;            ///< given by its place
  bool required = false;
  bool several = false;  ///< takes more than one value
};

/// A command line, or one of its commands.
struct CommandEntry {
  std::string name, help;
  std::vector<OptionEntry> options;
  std::vector<CommandEntry> commands;
};

/// Options and arguments of a program, or of one of its commands; by CLI11, whose header takes 4 s of compile
/// time.
class CommandOptions {
 public:
  /// What CLI11 does not hand back: the allowed values of an option.
  struct Allowed {
    std::string text;
    std::vector<std::string> choice;
  };
  using AllowedValues = std::map<const CLI::Option*, Allowed>;

  /// One of them, with what it must fulfil.
  class Option {
   public:
    Option(CLI::Option* option, AllowedValues* allowed) : option_(option), allowed_(allowed) {}
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
    const Option& number(const std::string& allowed, const std::function<bool(double)>& good) const;

    CLI::Option* option_;
    AllowedValues* allowed_;
  };

  CommandOptions(CLI::App* app, std::shared_ptr<AllowedValues> allowed)
      : app_(app), allowed_(std::move(allowed)) {}

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
  std::shared_ptr<AllowedValues> allowed_;
};

class CommandLine : public CommandOptions {
 public:
  /// @param program how messages and --help name it; empty: as it was started
  explicit CommandLine(const std::string& description = "", const std::string& program = "");
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;
  ~CommandLine();

  /// A command with options of its own; one of them must be given.
  CommandOptions command(const std::string& name, const std::string& help);
  /// Text after the options in --help; replaces the one before.
  void footer(const std::string& text);
  std::string footer() const;
  std::string help() const;
  /// The name in messages; known from the start or once the command line is parsed.
  const std::string& program() const { return program_; }
  CommandEntry entry() const;

  struct Stop {
    bool stop = false;  ///< the error or the help has been printed, the program must end
    int code = 0;       ///< with this exit code
  };
  Stop parse(int argc, const char* const* argv);

 private:
  std::unique_ptr<CLI::App> root_;
  std::string program_;
};

/// Body of a command-line program's main: parses the command line, then runs. @return the exit code: what
/// `run` returns; 1 after an exception, reported in one line "PROGRAM: what" on standard error; 2 for a
/// refused command line, reported in the same way.
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
