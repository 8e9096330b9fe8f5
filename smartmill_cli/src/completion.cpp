#include "smartmill_cli/completion.h"

#include <cstdio>
#include <memory>

#include "smartmill_core/formatted.h"

namespace smartmill {
namespace {

/// Lines of the script's tables, of a command and those below it.
struct Tables {
  std::string options, values;

  void add(const std::string& name, const CommandEntry& entry) {
    std::vector<std::string> names, commands;
    for (const OptionEntry& option : entry.options) {
      if (option.argument) continue;
      names.insert(names.end(), option.names.begin(), option.names.end());
      if (option.value.empty()) continue;
      std::string pattern;
      for (const std::string& one : option.names)
        pattern += (pattern.empty() ? "'" : " | '") + name + " " + one + "'";
      const std::string words = !option.choice.empty()   ? "words='" + joined(option.choice, " ") + "'"
                                : option.value == "TEXT" ? "files=yes"
                                                         : "words=";
      values += "    " + pattern + ") " + words + " ;;\n";
    }
    for (const CommandEntry& command : entry.commands) commands.push_back(command.name);
    std::vector<std::string> places;
    for (const OptionEntry& option : entry.options)
      if (option.argument) places.insert(places.end(), option.choice.begin(), option.choice.end());
    options += "    '" + name + "') options='" + joined(names, " ") + "'";
    if (!commands.empty()) options += " commands='" + joined(commands, " ") + "'";
    if (!places.empty()) options += " words='" + joined(places, " ") + "'";
    options += " ;;\n";
    for (const CommandEntry& command : entry.commands) add(name + " " + command.name, command);
  }
};

constexpr const char* FRAME = R"(# bash completion of %NAME %VERSION, printed by `%NAME completion bash`

# The options, the commands and the words for arguments of a command.
_%NAME_options() {
  case $1 in
%OPTIONS  esac
}

# The words for the value of a command's option, or that it is a file; fails for a flag.
_%NAME_values() {
  case $1 in
%VALUES    *) return 1 ;;
  esac
}

_%NAME() {
  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]}
  local command=${COMP_WORDS[1]} nested= options= commands= words= files= i
  COMPREPLY=()
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W '%COMMANDS --help --version' -- "$cur"))
    return
  fi
  # --option=value arrives in three words.
  if [ "$cur" = = ]; then
    cur=
  elif [ "$prev" = = ]; then
    prev=${COMP_WORDS[COMP_CWORD - 2]}
  fi
  _%NAME_options "$command"
  for ((i = 2; i < COMP_CWORD; i++)); do
    if [[ " $commands " == *" ${COMP_WORDS[i]} "* ]]; then
      nested=${COMP_WORDS[i]}
      command="$command $nested"
      commands= options= words=
      _%NAME_options "$command"
      break
    fi
  done
  if [[ $prev == -* ]] && _%NAME_values "$command $prev"; then
    COMPREPLY=($(compgen -W "$words" -- "$cur"))
  elif [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W "$options" -- "$cur"))
    return
  else
    COMPREPLY=($(compgen -W "$commands $words" -- "$cur"))
    files=yes
  fi
  [ -n "$files" ] || return 0
  compopt -o filenames 2>/dev/null
  while IFS= read -r i; do COMPREPLY+=("$i"); done < <(compgen -f -- "$cur")
}

complete -F _%NAME %NAME
)";

void replaceAll(std::string& text, const std::string& mark, const std::string& with) {
  for (std::size_t at = 0; (at = text.find(mark, at)) != std::string::npos; at += with.size())
    text.replace(at, mark.size(), with);
}

}  // namespace

std::string bashCompletion(const CommandProgram& program) {
  Tables tables;
  std::vector<std::string> names;
  const auto add = [&](const Command& command) {
    tables.add(command.name, CommandRun(command, program.name).line().entry());
  };
  for (const CommandTopic& topic : program.topics) {
    for (const Command& command : topic.commands) {
      names.push_back(command.name);
      add(command);
    }
  }
  for (const Command& command : program.hidden) add(command);
  std::string script = FRAME;
  replaceAll(script, "%OPTIONS", tables.options);
  replaceAll(script, "%VALUES", tables.values);
  replaceAll(script, "%COMMANDS", joined(names, " "));
  replaceAll(script, "%NAME", program.name);
  replaceAll(script, "%VERSION", program.version);
  return script;
}

Command completionCommand(const CommandProgram& program) {
  Command command("completion", "prints a shell script that completes command lines");
  command.description = "Prints a shell script that completes commands, options, words and files.";
  command.examples = {{"bash > ~/.local/share/bash-completion/completions/" + program.name,
                       "installs it for the user; `source <(" + program.name +
                           " completion bash)` loads it into the running shell"}};
  command.declare = [program](CommandLine& line) -> std::function<int()> {
    const auto shell = std::make_shared<std::string>();
    line.option("SHELL", *shell, "the shell").required().oneOf({"bash"});
    return [program, shell] {
      CommandProgram whole = program;
      whole.hidden.push_back(completionCommand(program));
      std::fputs(bashCompletion(whole).c_str(), stdout);
      return 0;
    };
  };
  return command;
}

}  // namespace smartmill
