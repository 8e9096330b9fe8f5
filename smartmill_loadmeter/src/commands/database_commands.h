#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/program.h"

namespace smartmill::loadmeter {

/// What the commands of the database are given; each uses some of them.
struct DatabaseOptions {
  std::string program, file, tool, material, other, shop, login, password_file, machine, campaign, prior;
  bool all = false;
  double cutting_speed = NAN, feed = NAN, diameter = NAN, helix = NAN, rake = NAN, age = NAN;
};

/// Commands of one command line; the one that was given runs.
class DatabaseCommands {
 public:
  using Body = void (*)(const DatabaseOptions&);

  explicit DatabaseCommands(CommandLine& line) : line_(line) {}
  DatabaseOptions& options() { return *options_; }
  CommandOptions add(const std::string& name, const std::string& help, Body body);
  /// Runs the command that was given; outlives the command line's declaration.
  std::function<int()> body() const;

 private:
  CommandLine& line_;
  std::shared_ptr<DatabaseOptions> options_ = std::make_shared<DatabaseOptions>();
  std::vector<std::pair<CommandOptions, Body>> commands_;
};

/// @throws Error on a file that does not exist; a fleet's server is not looked up.
void requireExists(const std::string& file);

/// Health records and explanations, which the database holds in addition to coefficients.
void addEvidenceCommands(DatabaseCommands& commands);
/// Exchange with a fleet's server.
void addFleetCommands(DatabaseCommands& commands);

}  // namespace smartmill::loadmeter
