#include "smartmill_core/program.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>

#include <CLI/CLI.hpp>

#include "smartmill_core/formatted.h"

namespace smartmill {

using Option = CommandOptions::Option;

namespace {

/// "a, b or c"
std::string alternatives(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " or " : ", ") + words[i];
  return text;
}

OptionEntry entryOf(const CLI::Option& option, const CommandOptions::AllowedValues& allowed) {
  OptionEntry entry;
  entry.argument = option.get_positional();
  if (entry.argument) entry.names.push_back(option.get_name(true));
  for (const std::string& name : option.get_snames()) entry.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) entry.names.push_back("--" + name);
  entry.help = option.get_description();
  entry.required = option.get_required();
  if (option.get_expected_max() == 0) return entry;  // a flag
  entry.initial = option.get_default_str();
  const std::string type = option.get_type_name();
  entry.value = type.substr(0, type.find_first_of(": "));
  entry.several = option.get_expected_max() > 1;
  if (const auto found = allowed.find(&option); found != allowed.end()) {
    entry.allowed = found->second.text;
    entry.choice = found->second.choice;
  }
  return entry;
}

CommandEntry entryOf(const CLI::App& app, const CommandOptions::AllowedValues& allowed) {
  CommandEntry entry{app.get_name(), app.get_description(), {}, {}};
  for (const CLI::Option* option : app.get_options()) entry.options.push_back(entryOf(*option, allowed));
  const auto every = [](const CLI::App*) { return true; };
  for (const CLI::App* command : app.get_subcommands(every))
    entry.commands.push_back(entryOf(*command, allowed));
  return entry;
}

}  // namespace

const Option& Option::required() const {
  option_->required();
  return *this;
}

const Option& Option::showDefault() const {
  option_->capture_default_str();
  return *this;
}

const Option& Option::within(double low, double high) const {
  return number(formatted("%g to %g", low, high), [low, high](double v) { return v >= low && v <= high; });
}

const Option& Option::positive() const {
  return number("above 0", [](double v) { return v > 0.0; });
}

const Option& Option::notNegative() const {
  return number("0 or more", [](double v) { return v >= 0.0; });
}

const Option& Option::number(const std::string& allowed, const std::function<bool(double)>& good) const {
  option_->check(CLI::Validator(
      [allowed, good](const std::string& text) {
        double value = 0.0;
        return CLI::detail::lexical_cast(text, value) && good(value) ? std::string()
                                                                     : text + ": expected " + allowed;
      },
      allowed));
  (*allowed_)[option_].text = allowed;
  return *this;
}

const Option& Option::oneOf(const std::vector<std::string>& words) const {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "{" : ",") + word;
  option_->check(CLI::Validator(
      [words](const std::string& text) {
        return std::find(words.begin(), words.end(), text) != words.end()
                   ? std::string()
                   : text + ": expected " + alternatives(words);
      },
      list + "}"));
  (*allowed_)[option_] = {alternatives(words), words};
  return *this;
}

const Option& Option::existingFile() const {
  option_->check(CLI::ExistingFile);
  return *this;
}

const Option& Option::count(int least, int most) const {
  option_->expected(least, most);
  return *this;
}

const Option& Option::commas() const {
  option_->delimiter(',');
  return *this;
}

const Option& Option::needs(const Option& other) const {
  option_->needs(other.option_);
  return *this;
}

const Option& Option::excludes(const Option& other) const {
  option_->excludes(other.option_);
  return *this;
}

template <typename T>
Option CommandOptions::option(const std::string& name, T& value, const std::string& help) const {
  return {app_->add_option(name, value, help), allowed_.get()};
}

template Option CommandOptions::option(const std::string&, std::string&, const std::string&) const;
template Option CommandOptions::option(const std::string&, double&, const std::string&) const;
template Option CommandOptions::option(const std::string&, int&, const std::string&) const;
template Option CommandOptions::option(const std::string&, unsigned&, const std::string&) const;
template Option CommandOptions::option(const std::string&, std::uint16_t&, const std::string&) const;
template Option CommandOptions::option(const std::string&, std::optional<double>&, const std::string&) const;
template Option CommandOptions::option(const std::string&, std::uint64_t&, const std::string&) const;
template Option CommandOptions::option(const std::string&, std::vector<std::string>&,
                                       const std::string&) const;
template Option CommandOptions::option(const std::string&, std::vector<double>&, const std::string&) const;

Option CommandOptions::flag(const std::string& name, bool& value, const std::string& help) const {
  return {app_->add_flag(name, value, help), allowed_.get()};
}

bool CommandOptions::parsed() const {
  return app_->parsed();
}

CommandLine::CommandLine(const std::string& description, const std::string& program)
    : CommandOptions(nullptr, std::make_shared<AllowedValues>()),
      root_(std::make_unique<CLI::App>(description)),
      program_(program) {
  app_ = root_.get();
}

CommandLine::~CommandLine() = default;

CommandOptions CommandLine::command(const std::string& name, const std::string& help) {
  root_->require_subcommand(1);
  return {root_->add_subcommand(name, help), allowed_};
}

void CommandLine::footer(const std::string& text) {
  root_->footer(text);
}

std::string CommandLine::footer() const {
  return root_->get_footer();
}

std::string CommandLine::help() const {
  return root_->help();
}

CommandEntry CommandLine::entry() const {
  return entryOf(*root_, *allowed_);
}

void CommandLine::runAfterParsing() const {
  for (const auto& action : after_parsing_) action();
}

CommandLine::Stop CommandLine::parse(int argc, const char* const* argv) {
  if (program_.empty()) program_ = argc > 0 ? std::filesystem::path(argv[0]).filename().string() : "program";
  root_->name(program_);
  try {
    root_->parse(argc, argv);
  } catch (const CLI::Success& request) {
    return {true, root_->exit(request)};
  } catch (const CLI::ParseError& error) {
    std::string what = error.what();
    std::replace(what.begin(), what.end(), '\n', ' ');
    std::fprintf(stderr, "%s: %s (see %s --help)\n", program_.c_str(), what.c_str(), program_.c_str());
    return {true, 2};
  }
  return {};
}

int runProgram(CommandLine& line, int argc, const char* const* argv, const std::function<int()>& run) {
  if (const CommandLine::Stop parsed = line.parse(argc, argv); parsed.stop) return parsed.code;
  try {
    line.runAfterParsing();
    return run();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", line.program().c_str(), e.what());
    return dynamic_cast<const UsageError*>(&e) ? 2 : 1;
  }
}

}  // namespace smartmill
