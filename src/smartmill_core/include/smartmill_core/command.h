#pragma once

#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "smartmill_core/program.h"

namespace smartmill {

/// An example: arguments without the program's name, and what the command then does.
struct CommandExample {
  std::string arguments, what;
};

/// An exit code and its meaning.
struct ExitCode {
  int code = 0;
  std::string meaning;
};

/// A file that a command reads or writes.
struct CommandFile {
  std::string name, what;
};

/// A tool: a program of its own (runCommand) and a command of the program `smartmill`.
struct Command {
  Command() = default;
  /// @param command name, e.g. "cutting-frf"; the tool is then "cutting_frf" @param what summary
  Command(const std::string& command, const std::string& what);

  /// Sets declare().
  /// @param run body with the parsed options; returns the exit code, or nothing for 0
  /// @param add declares the options; their defaults are those of the struct
  template <class Options, class Result>
  void setBody(Result (*run)(const Options&), void (*add)(CommandLine&, std::enable_if_t<true, Options>&));

  std::string name;         ///< of the command, e.g. "cutting-frf"
  std::string tool;         ///< of the program in its package, e.g. "cutting_frf"
  std::string summary;      ///< one line without a full stop
  std::string description;  ///< one paragraph, the first thing in --help
  std::vector<CommandExample> examples;
  std::vector<CommandFile> files;
  std::vector<ExitCode> exits;  ///< those that differ from, or are added to, exitCodes()
  /// Declares the options. @return the body, which owns the option values; it runs after the command line is
  /// parsed and returns the exit code.
  std::function<std::function<int()>(CommandLine&)> declare;
};

template <class Options, class Result>
void Command::setBody(Result (*run)(const Options&),
                      void (*add)(CommandLine&, std::enable_if_t<true, Options>&)) {
  declare = [run, add](CommandLine& line) -> std::function<int()> {
    const auto options = std::make_shared<Options>();
    add(line, *options);
    return [run, options] {
      if constexpr (std::is_void_v<Result>) {
        run(*options);
        return 0;
      } else {
        return run(*options);
      }
    };
  };
}

/// Commands within a command, which share their options; the one that was given runs.
template <class Options>
class Subcommands {
 public:
  explicit Subcommands(CommandLine& line) : line_(line) {}
  Options& options() { return *options_; }
  CommandOptions add(const std::string& name, const std::string& help, void (*run)(const Options&)) {
    commands_.emplace_back(line_.command(name, help), run);
    return commands_.back().first;
  }
  /// Body of the command; outlives the command line's declaration.
  std::function<int()> body() const {
    return [options = options_, commands = commands_] {
      for (const auto& [command, run] : commands)
        if (command.parsed()) run(*options);
      return 0;
    };
  }

 private:
  CommandLine& line_;
  std::shared_ptr<Options> options_ = std::make_shared<Options>();
  std::vector<std::pair<CommandOptions, void (*)(const Options&)>> commands_;
};

/// Exit codes of a command in ascending order: 0 done, 1 error, 2 bad command line, 130 interrupted, and
/// those of the command.
std::vector<ExitCode> exitCodes(const Command& command);

/// A command line with the command's options, its examples and exit codes at the end of --help.
class CommandRun {
 public:
  /// @param program the name in messages, e.g. "explain" or "smartmill explain"
  CommandRun(const Command& command, const std::string& program);
  CommandLine& line() { return line_; }
  /// The command's own text at the end of --help: its parameters.
  const std::string& notes() const { return notes_; }
  /// As runProgram: argv[0] is skipped. @return the exit code
  int run(int argc, const char* const* argv);

 private:
  CommandLine line_;
  std::function<int()> body_;
  std::string notes_;
};

/// main of a program with a single command; messages use the name by which it was started.
int runCommand(const Command& command, int argc, const char* const* argv);

/// Commands of one topic, listed under its heading in --help.
struct CommandTopic {
  std::string title;
  std::vector<Command> commands;
};

/// A program made of commands.
struct CommandProgram {
  std::string name, summary, version;
  std::vector<CommandTopic> topics;
  std::vector<Command> hidden;  ///< runs like the others, not listed in --help

  /// nullptr if no command has the name.
  const Command* find(const std::string& command) const;
  /// The command whose name or tool name is nearest to an unknown word by edit distance; empty when none is
  /// near.
  std::string nearest(const std::string& word) const;
  /// The text of --help.
  std::string help() const;
};

/// main of a program made of commands. @return the exit code
int runCommands(const CommandProgram& program, int argc, const char* const* argv);

}  // namespace smartmill
