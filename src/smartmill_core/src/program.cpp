#include "smartmill_core/program.h"

#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>

#include <CLI/CLI.hpp>

namespace smartmill {

using Option = CommandOptions::Option;

const Option& Option::required() const {
  option_->required();
  return *this;
}

const Option& Option::showDefault() const {
  option_->capture_default_str();
  return *this;
}

const Option& Option::within(double low, double high) const {
  option_->check(CLI::Range(low, high));
  return *this;
}

const Option& Option::positive() const {
  option_->check(CLI::PositiveNumber);
  return *this;
}

const Option& Option::notNegative() const {
  option_->check(CLI::NonNegativeNumber);
  return *this;
}

const Option& Option::oneOf(const std::vector<std::string>& words) const {
  option_->check(CLI::IsMember(words));
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
  return Option(app_->add_option(name, value, help));
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
  return Option(app_->add_flag(name, value, help));
}

bool CommandOptions::parsed() const {
  return app_->parsed();
}

CommandLine::CommandLine(const std::string& description)
    : CommandOptions(nullptr), root_(std::make_unique<CLI::App>(description)) {
  app_ = root_.get();
}

CommandLine::~CommandLine() = default;

CommandOptions CommandLine::command(const std::string& name, const std::string& help) {
  root_->require_subcommand(1);
  return CommandOptions(root_->add_subcommand(name, help));
}

void CommandLine::footer(const std::string& text) {
  root_->footer(text);
}

std::string CommandLine::help() const {
  return root_->help();
}

CommandLine::Stop CommandLine::parse(int argc, const char* const* argv) {
  try {
    root_->parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return {true, root_->exit(e) == 0 ? 0 : 2};
  }
  return {};
}

int runProgram(CommandLine& line, int argc, const char* const* argv, const std::function<int()>& run) {
  const std::string name = argc > 0 ? std::filesystem::path(argv[0]).filename().string() : "program";
  if (const CommandLine::Stop parsed = line.parse(argc, argv); parsed.stop) return parsed.code;
  try {
    return run();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), e.what());
    return dynamic_cast<const UsageError*>(&e) ? 2 : 1;
  }
}

}  // namespace smartmill
