#include "smartmill_cli/manual.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

/// Text as roff shows it: no escapes, hyphens as minus signs, no line taken for a request.
std::string roff(const std::string& text) {
  std::string out;
  bool begin = true;
  for (const char c : text) {
    if (begin && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if (c == '`') {
      out += "\\(ga";
    } else if (c == '\'') {
      out += "\\(aq";
    } else if (c == '~') {
      out += "\\(ti";
    } else if (c == '^') {
      out += "\\(ha";
    } else {
      out += c;
    }
    begin = c == '\n';
  }
  return out;
}

std::string bold(const std::string& text) {
  return "\\fB" + roff(text) + "\\fR";
}

std::string italic(const std::string& text) {
  return "\\fI" + roff(text) + "\\fR";
}

/// A tagged paragraph.
std::string tagged(const std::string& tag, const std::string& text) {
  return ".TP\n" + tag + "\n" + roff(text) + "\n";
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

std::string title(const CommandProgram& program, const std::string& page) {
  return ".TH " + roff(upper(page)) + " 1 \"\" \"SmartMill " + roff(program.version) +
         "\" \"SmartMill Manual\"\n";
}

std::string optionText(const OptionEntry& option) {
  std::string tag;
  for (const std::string& name : option.names)
    tag += (tag.empty() ? "" : ", ") + (option.argument ? italic(name) : bold(name));
  if (!option.argument && !option.value.empty()) tag += " " + italic(option.value);
  if (option.several) tag += " ...";
  std::string text = option.help.empty() ? "" : option.help + ".";
  const auto add = [&text](const std::string& sentence) { text += (text.empty() ? "" : " ") + sentence; };
  if (option.required) add("Required.");
  if (!option.allowed.empty()) add("Allowed: " + option.allowed + ".");
  if (!option.initial.empty()) add("Default: " + option.initial + ".");
  return tagged(tag, text);
}

std::string optionsText(const CommandEntry& entry) {
  std::string text;
  for (const bool arguments : {true, false})
    for (const OptionEntry& option : entry.options)
      if (option.argument == arguments) text += optionText(option);
  return text;
}

/// What must be given, after the program's name.
std::string synopsis(const CommandEntry& entry) {
  std::string text = " [" + italic("OPTIONS") + "]";
  for (const OptionEntry& option : entry.options) {
    if (option.argument) continue;
    if (option.required) text += " " + bold(option.names.back()) + " " + italic(option.value);
  }
  for (const OptionEntry& option : entry.options) {
    if (!option.argument) continue;
    const std::string place = italic(option.names.front()) + (option.several ? " ..." : "");
    text += option.required ? " " + place : " [" + place + "]";
  }
  return text;
}

std::string exitText(const Command& command) {
  std::string text = ".SH EXIT STATUS\n";
  for (const ExitCode& code : exitCodes(command))
    text += tagged(bold(std::to_string(code.code)), code.meaning);
  return text;
}

std::string exampleText(const CommandProgram& program, const Command& command,
                        const CommandExample& example) {
  return ".PP\n" + roff(example.what) + ":\n.PP\n.in +4n\n.EX\n" +
         roff(program.name + " " + command.name + " " + example.arguments) + "\n.EE\n.in\n";
}

std::string page(const CommandProgram& program, const Command& command, const CommandTopic& topic) {
  CommandRun run(command, program.name + " " + command.name);
  const CommandEntry entry = run.line().entry();
  const std::string name = program.name + "-" + command.name;
  std::string text = title(program, name);
  text += ".SH NAME\n" + roff(name) + " \\- " + roff(command.summary) + "\n";
  text += ".SH SYNOPSIS\n.nh\n.ad l\n" + bold(program.name + " " + command.name) + synopsis(entry);
  if (!entry.commands.empty()) text += " " + italic("COMMAND") + " ...";
  text += "\n.ad\n.hy\n.SH DESCRIPTION\n" + roff(command.description) + "\n";
  if (!entry.commands.empty()) text += ".SH COMMANDS\n";
  for (const CommandEntry& nested : entry.commands)
    text += ".SS " + bold(nested.name) + synopsis(nested) + "\n" + roff(nested.help) + ".\n" +
            optionsText(nested);
  text += ".SH OPTIONS\n" + optionsText(entry);
  if (!run.notes().empty())
    text += ".SH PARAMETERS\nKeys of the file that " + bold("--params") +
            " names, with their defaults.\n.PP\n.EX\n" +
            roff(run.notes().substr(run.notes().find_first_not_of('\n'))) + "\n.EE\n";
  text += ".SH EXAMPLES\n";
  for (const CommandExample& example : command.examples) text += exampleText(program, command, example);
  text += exitText(command) + ".SH FILES\n";
  for (const CommandFile& file : command.files) text += tagged(italic(file.name), file.what);
  text += ".SH SEE ALSO\n" + bold(program.name) + "(1)";
  for (const Command& other : topic.commands)
    if (other.name != command.name) text += ",\n" + bold(program.name + "-" + other.name) + "(1)";
  return text + "\n";
}

std::string overview(const CommandProgram& program) {
  std::string text = title(program, program.name);
  text += ".SH NAME\n" + roff(program.name) + " \\- measured and simulated milling\n";
  text += ".SH SYNOPSIS\n" + bold(program.name) + " " + italic("COMMAND") + " [" + italic("ARGUMENTS") +
          "]\n.br\n" + bold(program.name) + " " + italic("COMMAND") + " " + bold("--help") + "\n.br\n" +
          bold(program.name) + " " + bold("--help") + " | " + bold("--version") + "\n";
  text += ".SH DESCRIPTION\n" + roff(program.summary) + "\nEvery command has a manual page of its own.\n";
  text += ".SH COMMANDS\n";
  for (const CommandTopic& topic : program.topics) {
    text += ".SS " + roff(topic.title) + "\n";
    for (const Command& command : topic.commands)
      text += tagged(bold(program.name + "-" + command.name) + "(1)", command.summary + ".");
  }
  text += ".SH OPTIONS\n" + tagged(bold("-h") + ", " + bold("--help"), "Prints the commands.") +
          tagged(bold("--version"), "Prints the version.");
  text += ".SH EXAMPLES\n";
  for (const CommandTopic& topic : program.topics)
    text += exampleText(program, topic.commands.front(), topic.commands.front().examples.front());
  text += exitText({}) + ".SH FILES\n" +
          tagged(italic("campaign.yaml"), "plan and records of a campaign, in the campaign's folder") +
          tagged(italic("model.yaml"), "a machine model");
  text += ".SH SEE ALSO\n";
  std::string pages;
  for (const CommandTopic& topic : program.topics)
    for (const Command& command : topic.commands)
      pages += (pages.empty() ? "" : ",\n") + bold(program.name + "-" + command.name) + "(1)";
  return text + pages + "\n";
}

}  // namespace

std::map<std::string, std::string> manualPages(const CommandProgram& program) {
  std::map<std::string, std::string> pages{{program.name + ".1", overview(program)}};
  for (const CommandTopic& topic : program.topics)
    for (const Command& command : topic.commands)
      pages[program.name + "-" + command.name + ".1"] = page(program, command, topic);
  return pages;
}

std::string commandTables(const CommandProgram& program) {
  std::string text;
  for (const CommandTopic& topic : program.topics) {
    text += (text.empty() ? "### " : "\n### ") + topic.title + "\n\n| command | does |\n|---|---|\n";
    for (const Command& command : topic.commands)
      text += "| `" + command.name + "` | " + command.summary + " |\n";
  }
  return text;
}

Command manualCommand(const CommandProgram& program) {
  Command command("manual", "writes the manual pages");
  command.description = "Writes the manual pages of the program and its commands, in man(7) macros.";
  command.examples = {{"-o share/man/man1", "one page per command"},
                      {"--tables", "prints the tables of docs/program.md"}};
  command.declare = [program](CommandLine& line) -> std::function<int()> {
    struct Arguments {
      std::string folder;
      bool tables = false;
    };
    const auto a = std::make_shared<Arguments>();
    line.option("-o,--out", a->folder, "folder for the pages");
    line.flag("--tables", a->tables, "prints the commands as tables of Markdown");
    return [program, a] {
      if (a->folder.empty() && !a->tables) throw UsageError("--out or --tables is required");
      if (a->tables) std::fputs(commandTables(program).c_str(), stdout);
      if (a->folder.empty()) return 0;
      std::filesystem::create_directories(a->folder);
      for (const auto& [name, text] : manualPages(program)) {
        const std::string path = a->folder + "/" + name;
        std::ofstream file(path);
        if (!(file << text).flush()) throw Error(path + ": cannot be written");
      }
      return 0;
    };
  };
  return command;
}

}  // namespace smartmill
