#include "smartmill_core/command.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <numeric>

#include "smartmill_core/formatted.h"

namespace smartmill {
namespace {

std::string startedAs(int argc, const char* const* argv) {
  return argc > 0 ? std::filesystem::path(argv[0]).filename().string() : "program";
}

/// Damerau-Levenshtein distance (optimal string alignment).
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  std::iota(d[0].begin(), d[0].end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      d[i][j] =
          std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

Command::Command(const std::string& command, const std::string& what)
    : name(command), tool(command), summary(what) {
  std::replace(tool.begin(), tool.end(), '-', '_');
}

std::vector<ExitCode> exitCodes(const Command& command) {
  std::vector<ExitCode> codes{{0, "done"},
                              {1, "error, reported in one line on standard error"},
                              {2, "bad command line"},
                              {130, "interrupted by Ctrl-C"}};
  for (const ExitCode& own : command.exits) {
    const auto same = std::find_if(codes.begin(), codes.end(),
                                   [&own](const ExitCode& code) { return code.code == own.code; });
    if (same != codes.end()) {
      same->meaning = own.meaning;
    } else {
      codes.push_back(own);
    }
  }
  std::sort(codes.begin(), codes.end(), [](const ExitCode& a, const ExitCode& b) { return a.code < b.code; });
  return codes;
}

CommandRun::CommandRun(const Command& command, const std::string& program)
    : line_(command.description, program), body_(command.declare(line_)), notes_(line_.footer()) {
  std::string footer = notes_;
  footer += footer.empty() ? "Examples:\n" : footer.back() == '\n' ? "\nExamples:\n" : "\n\nExamples:\n";
  for (const CommandExample& example : command.examples)
    footer += "  " + program + " " + example.arguments + "\n      " + example.what + "\n";
  footer += "\nExit codes:\n";
  for (const ExitCode& code : exitCodes(command))
    footer += formatted("  %-4d %s\n", code.code, code.meaning.c_str());
  footer.pop_back();
  line_.footer(footer);
}

int CommandRun::run(int argc, const char* const* argv) {
  return runProgram(line_, argc, argv, body_);
}

int runCommand(const Command& command, int argc, const char* const* argv) {
  return CommandRun(command, startedAs(argc, argv)).run(argc, argv);
}

const Command* CommandProgram::find(const std::string& command) const {
  for (const CommandTopic& topic : topics)
    for (const Command& one : topic.commands)
      if (one.name == command) return &one;
  for (const Command& one : hidden)
    if (one.name == command) return &one;
  return nullptr;
}

std::string CommandProgram::nearest(const std::string& word) const {
  std::string closest;
  std::size_t least = std::max<std::size_t>(2, word.size() / 2) + 1;
  for (const CommandTopic& topic : topics) {
    for (const Command& one : topic.commands) {
      std::size_t edits = std::min(distance(word, one.name), distance(word, one.tool));
      if (!word.empty() && one.name.rfind(word, 0) == 0) edits = std::min<std::size_t>(edits, 1);
      if (edits >= least) continue;
      least = edits;
      closest = one.name;
    }
  }
  return closest;
}

std::string CommandProgram::help() const {
  std::string text = summary + "\nUsage: " + name + " COMMAND [ARGUMENTS]\n       " + name +
                     " COMMAND --help | --help | --version\n";
  std::size_t width = 0;
  for (const CommandTopic& topic : topics)
    for (const Command& one : topic.commands) width = std::max(width, one.name.size());
  for (const CommandTopic& topic : topics) {
    text += "\n" + topic.title + ":\n";
    for (const Command& one : topic.commands)
      text += formatted("  %-*s  %s\n", static_cast<int>(width), one.name.c_str(), one.summary.c_str());
  }
  text += "\nExit codes:\n";
  for (const ExitCode& code : exitCodes({}))
    text += formatted("  %-4d %s\n", code.code, code.meaning.c_str());
  return text;
}

int runCommands(const CommandProgram& program, int argc, const char* const* argv) {
  const char* const name = program.name.c_str();
  if (argc < 2) {
    std::fprintf(stderr, "%s: a command is required (see %s --help)\n", name, name);
    return 2;
  }
  const std::string word = argv[1];
  if (word == "--help" || word == "-h") {
    std::fputs(program.help().c_str(), stdout);
    return 0;
  }
  if (word == "--version") {
    std::printf("%s %s\n", name, program.version.c_str());
    return 0;
  }
  if (const Command* command = program.find(word))
    return CommandRun(*command, program.name + " " + word).run(argc - 1, argv + 1);
  const std::string nearest = program.nearest(word);
  std::fprintf(stderr, "%s: %s '%s'%s (see %s --help)\n", name,
               word.rfind('-', 0) == 0 ? "unknown option" : "unknown command", word.c_str(),
               nearest.empty() ? "" : (", did you mean '" + nearest + "'?").c_str(), name);
  return 2;
}

}  // namespace smartmill
