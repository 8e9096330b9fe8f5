#pragma once

#include <cmath>
#include <string>

#include "smartmill_core/command.h"

namespace smartmill::loadmeter {

/// What the commands of the database are given; each uses some of them.
struct DatabaseOptions {
  std::string program, file, tool, material, other, shop, login, password_file, machine, campaign, prior,
      model;
  bool all = false;
  double cutting_speed = NAN, feed = NAN, diameter = NAN, helix = NAN, rake = NAN, age = NAN, since = NAN;
};

using DatabaseCommands = Subcommands<DatabaseOptions>;

/// @throws Error on a file that does not exist; a fleet's server is not looked up.
void requireExists(const std::string& file);

/// Health records and explanations, which the database holds in addition to coefficients.
void addEvidenceCommands(DatabaseCommands& commands);
/// Measured dimensions of parts.
void addInspectionCommands(DatabaseCommands& commands);
/// Exchange with a fleet's server.
void addFleetCommands(DatabaseCommands& commands);

}  // namespace smartmill::loadmeter
