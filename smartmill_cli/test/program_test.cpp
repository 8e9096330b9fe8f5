// The program's command lines: help, examples, errors, completion, manual pages, and its document.

#include <algorithm>
#include <set>

#include <gmock/gmock.h>

#include "shell.h"
#include "smartmill_cli/commands.h"
#include "smartmill_cli/completion.h"
#include "smartmill_cli/manual.h"
#include "smartmill_core/version.h"

namespace smartmill {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

std::vector<Command> commands() {
  const CommandProgram program = smartmillProgram();
  std::vector<Command> all = program.hidden;
  for (const CommandTopic& topic : program.topics)
    all.insert(all.end(), topic.commands.begin(), topic.commands.end());
  return all;
}

Outcome smartmill(const std::string& arguments) {
  return shell(SMARTMILL " " + arguments);
}

/// Words of an example, up to a redirection.
std::vector<std::string> wordsOf(const std::string& arguments) {
  std::istringstream in(arguments);
  std::vector<std::string> words;
  for (std::string word; in >> word && word != ">";) words.push_back(word);
  return words;
}

TEST(Program, NamesEveryCommandOnce) {
  std::set<std::string> names;
  for (const Command& command : commands()) {
    EXPECT_TRUE(names.insert(command.name).second) << command.name;
    EXPECT_FALSE(command.summary.empty()) << command.name;
    EXPECT_NE(command.summary.back(), '.') << command.name;
    EXPECT_EQ(command.name.find('_'), std::string::npos) << command.name;
  }
  for (const char* due : {"explain", "gap", "simulate", "hide", "coefficients", "frf", "health", "compensate",
                          "cutting-frf", "lobes", "detect", "force-law", "database", "program"})
    EXPECT_EQ(names.count(due), 1u) << due;
}

TEST(Program, ListsItsCommandsAndTellsItsVersion) {
  const Outcome help = smartmill("--help");
  EXPECT_EQ(help.code, 0);
  for (const CommandTopic& topic : smartmillProgram().topics) {
    EXPECT_THAT(help.out, HasSubstr(topic.title));
    for (const Command& command : topic.commands) EXPECT_THAT(help.out, HasSubstr(command.summary));
  }
  const Outcome printed = smartmill("--version");
  EXPECT_EQ(printed.code, 0);
  EXPECT_EQ(printed.out, std::string("smartmill ") + version() + "\n");
  EXPECT_THAT(readText(MANIFEST), HasSubstr(std::string("<version>") + version() + "</version>"));
}

TEST(Program, EndsTheHelpOfEveryCommandWithExamplesAndExitCodes) {
  for (const Command& command : commands()) {
    const Outcome help = smartmill(command.name + " --help");
    EXPECT_EQ(help.code, 0) << command.name;
    EXPECT_EQ(help.error, "") << command.name;
    ASSERT_FALSE(command.examples.empty()) << command.name;
    const std::size_t examples = help.out.find("\nExamples:\n");
    ASSERT_NE(examples, std::string::npos) << command.name;
    for (const CommandExample& example : command.examples)
      EXPECT_THAT(help.out.substr(examples),
                  HasSubstr("  smartmill " + command.name + " " + example.arguments + "\n"));
    EXPECT_THAT(help.out.substr(examples), HasSubstr("\nExit codes:\n  0    "));
  }
}

TEST(Program, AcceptsEveryExampleAsACommandLine) {
  for (const Command& command : commands()) {
    for (const CommandExample& example : command.examples) {
      std::vector<std::string> words = wordsOf(example.arguments);
      words.insert(words.begin(), command.name);
      std::vector<const char*> argv;
      for (const std::string& word : words) argv.push_back(word.c_str());
      CommandRun run(command, "smartmill " + command.name);
      EXPECT_FALSE(run.line().parse(static_cast<int>(argv.size()), argv.data()).stop)
          << command.name << " " << example.arguments;
    }
  }
}

/// Exit code 2, and one line that begins with the program's name.
void expectRefused(const std::string& arguments, const std::string& begin, const std::string& part) {
  const Outcome refused = smartmill(arguments);
  EXPECT_EQ(refused.code, 2) << arguments;
  EXPECT_EQ(refused.out, "") << arguments;
  EXPECT_EQ(linesOf(refused.error), 1u) << refused.error;
  EXPECT_THAT(refused.error, AllOf(StartsWith(begin), HasSubstr(part), EndsWith(" --help)\n"))) << arguments;
}

TEST(Program, RefusesABadCommandLineInOneLine) {
  expectRefused("", "smartmill: ", "a command is required");
  expectRefused("explian", "smartmill: ", "did you mean 'explain'?");
  expectRefused("cutting_frf", "smartmill: ", "did you mean 'cutting-frf'?");
  expectRefused("coefficients_db", "smartmill: ", "did you mean 'database'?");
  expectRefused("coef", "smartmill: ", "did you mean 'coefficients'?");
  expectRefused("--verbose", "smartmill: ", "unknown option '--verbose'");
  expectRefused("gap", "smartmill gap: ", "CAMPAIGN is required");
  expectRefused("explain campaign", "smartmill explain: ", "--out is required");
  expectRefused("gap campaign --threads 99", "smartmill gap: ", "99: expected 1 to 64");
  expectRefused("gap campaign --threads many", "smartmill gap: ", "many: expected 1 to 64");
  expectRefused("frf tap.csv --average mean", "smartmill frf: ", "mean: expected h1, h2 or hv");
  expectRefused("gap campaign --thread 2", "smartmill gap: ", "--thread");
  expectRefused("database machine.sqlite", "smartmill database: ", "required");
  EXPECT_THAT(smartmill("quaternion").error, Not(HasSubstr("did you mean")));
}

TEST(Program, NamesAFileThatIsMissingInOneLine) {
  for (const std::string arguments :
       {"explain nowhere -o out", "gap nowhere", "simulate nowhere.yaml campaign -o out",
        "hide nowhere.yaml -o out.yaml", "coefficients nowhere", "frf nowhere.csv", "health nowhere.bag",
        "compensate nowhere -o out", "cutting-frf nowhere -o out",
        "detect nowhere.wav --speed 8000 --teeth 4",
        "lobes nowhere.yaml --entry-deg 0 --exit-deg 180 --speeds 1e3:2e3:3 --max-depth-mm 1 -o out.csv",
        "program nowhere.nc --stock-mm 1 1 1 --model nowhere.yaml -o out", "force-law nowhere",
        "database nowhere.sqlite list", "calibrate nowhere", "sensor-report nowhere",
        "chart nowhere.bag --model nowhere.yaml", "spindle-sensor verify nowhere.yaml nowhere.csv",
        "plan-cuts nowhere.yaml --speeds 3000 --feeds 0.1 0.2 0.3 --depths 1 --ktc-std 9 --kte-std 1"}) {
    const Outcome failed = smartmill(arguments);
    EXPECT_EQ(failed.code, 1) << arguments;
    EXPECT_EQ(failed.out, "") << arguments;
    const std::string last = failed.error.substr(
        failed.error.size() < 2 ? 0 : failed.error.rfind('\n', failed.error.size() - 2) + 1);
    EXPECT_THAT(last, AllOf(StartsWith("smartmill " + arguments.substr(0, arguments.find(' ')) + ": "),
                            HasSubstr("nowhere")))
        << arguments << "\n"
        << failed.error;
  }
}

/// The completions of words, the last of which is being typed.
std::vector<std::string> completed(const std::string& words) {
  const int last = static_cast<int>(std::count(words.begin(), words.end(), ' '));
  const Outcome done =
      shell("touch taps.csv 'two words.csv'; mkdir campaigns\n" SMARTMILL
            " completion bash >.script; source ./.script\nCOMP_WORDS=(" +
            words + (words.back() == ' ' ? "''" : "") + "); COMP_CWORD=" + std::to_string(last) +
            "; _smartmill\n"
            "[ ${#COMPREPLY[@]} -eq 0 ] || printf '%s\\n' \"${COMPREPLY[@]}\"");
  EXPECT_EQ(done.error, "") << words;
  std::istringstream in(done.out);
  std::vector<std::string> found;
  for (std::string line; std::getline(in, line);) found.push_back(line);
  return found;
}

TEST(Completion, KnowsCommandsOptionsWordsAndFiles) {
  EXPECT_THAT(completed("smartmill expl"), ElementsAre("explain"));
  EXPECT_THAT(completed("smartmill c"),
              ::testing::IsSupersetOf({"coefficients", "compensate", "cutting-frf"}));
  EXPECT_THAT(completed("smartmill --v"), ElementsAre("--version"));
  EXPECT_THAT(completed("smartmill explain --th"), ElementsAre("--threads"));
  EXPECT_THAT(completed("smartmill explain --threads "), IsEmpty());
  EXPECT_THAT(completed("smartmill frf --average "), ElementsAre("h1", "h2", "hv"));
  EXPECT_THAT(completed("smartmill frf --average = h"), ElementsAre("h1", "h2", "hv"));
  EXPECT_THAT(completed("smartmill cutting-frf --of s"), ElementsAre("sensor"));
  EXPECT_THAT(completed("smartmill frf ta"), ElementsAre("taps.csv"));
  EXPECT_THAT(completed("smartmill frf --real-modes ta"), ElementsAre("taps.csv"));
  EXPECT_THAT(completed("smartmill frf tw"), ElementsAre("two words.csv"));
  EXPECT_THAT(completed("smartmill explain -o camp"), ElementsAre("campaigns"));
  EXPECT_THAT(completed("smartmill database machine.sqlite imp"), ElementsAre("import", "improvements"));
  EXPECT_THAT(completed("smartmill database machine.sqlite find --ed"), ElementsAre("--edge-age"));
  EXPECT_THAT(completed("smartmill database machine.sqlite list --ed"), IsEmpty());
  EXPECT_THAT(completed("smartmill spindle-sensor ver"), ElementsAre("verify"));
  EXPECT_THAT(completed("smartmill completion "), ::testing::Contains("bash"));
}

TEST(Manual, HasAPageForEveryCommandThatRoffAccepts) {
  const CommandProgram program = smartmillProgram();
  const auto pages = manualPages(program);
  const Outcome written = smartmill("manual -o pages");
  EXPECT_EQ(written.code, 0) << written.error;
  EXPECT_EQ(written.files.size(), pages.size());
  for (const CommandTopic& topic : program.topics) {
    for (const Command& command : topic.commands) {
      const auto page = pages.find("smartmill-" + command.name + ".1");
      ASSERT_NE(page, pages.end()) << command.name;
      for (const char* section :
           {"NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXAMPLES", "EXIT STATUS", "FILES", "SEE ALSO"})
        EXPECT_THAT(page->second, HasSubstr(std::string("\n.SH ") + section + "\n")) << command.name;
      EXPECT_FALSE(command.files.empty()) << command.name;
    }
  }
  if (shell("command -v groff").code != 0) GTEST_SKIP() << "groff is not installed";
  const Outcome checked =
      shell(SMARTMILL " manual -o pages && for p in pages/*; do groff -man -ww -z $p; done");
  EXPECT_EQ(checked.code, 0);
  EXPECT_EQ(checked.error, "");
}

TEST(Document, HoldsTheProgramsCommands) {
  EXPECT_THAT(readText(DOCUMENT), HasSubstr(commandTables(smartmillProgram())))
      << "smartmill manual --tables prints them";
}

}  // namespace
}  // namespace smartmill
