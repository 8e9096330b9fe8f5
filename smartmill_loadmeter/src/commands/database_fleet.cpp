#include <unistd.h>

#include <cmath>
#include <cstdio>

#include "commands/database_commands.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter/database/fleet_model.h"

namespace smartmill::loadmeter {
namespace {

void printProgress(const char* verb, const FleetTransfer& done) {
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\r%zu %s", done.offered, verb);
}

void transfer(const DatabaseOptions& o, bool out) {
  if (out) requireExists(o.file);
  CoefficientDatabase local(o.file);
  const char* verb = out ? "sent" : "received";
  const auto progress = [&](const FleetTransfer& done) { printProgress(verb, done); };
  const FleetTransfer done = out ? push(local, o.other, progress, o.all) : pull(local, o.other, progress);
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\r");
  std::printf("%zu new of %zu %s\n", done.fresh, done.offered, verb);
}

void migrate(const DatabaseOptions& o) {
  const int found = migrateFleet(o.file);
  if (found == FLEET_SCHEMA) {
    std::printf("tables have version %d already\n", found);
  } else if (found > 0) {
    std::printf("tables updated from version %d to %d\n", found, FLEET_SCHEMA);
  } else {
    std::printf("tables of version %d created\n", FLEET_SCHEMA);
  }
}

void enrolOne(const DatabaseOptions& o) {
  std::string password = o.password_file.empty() ? "" : readText(o.password_file);
  while (!password.empty() && (password.back() == '\n' || password.back() == '\r')) password.pop_back();
  FleetMember member;
  member.name = o.other;
  member.login = o.login.empty() ? o.other : o.login;
  member.shop = o.shop;
  enrol(o.file, member, password);
  std::printf("'%s' of shop '%s' logs in as '%s'\n", member.name.c_str(), member.shop.c_str(),
              member.login.c_str());
}

void members(const DatabaseOptions& o) {
  for (const FleetMember& m : fleetMembers(o.file)) {
    std::printf("%s of %s: %zu records", m.name.c_str(), m.shop.c_str(), m.records);
    if (std::isfinite(m.silent)) {
      std::printf(", last push %.0f s ago, %zu not sent then\n", m.silent, m.behind);
    } else {
      std::printf(", no push yet\n");
    }
  }
}

/// Prints the deviations and effects of the hierarchical model of Ktc and each machine's next cut.
void compareMachines(const DatabaseOptions& o) {
  requireExists(o.file);
  const auto records = CoefficientDatabase(o.file).records("", "");
  const FleetModel model(observationsOf(records, &CuttingCoefficients::ktc));
  const FleetDeviations s = model.deviations();
  std::printf(
      "# Ktc scatters by %.2f %% between machines, %.2f %% between batches, %.2f %% between tools, %.2f %% "
      "from cut to cut\n",
      100.0 * s.machine, 100.0 * s.batch, 100.0 * s.tool, 100.0 * s.noise);
  for (const MachineEffect& m : model.machines()) {
    std::printf("%s: %+.2f +- %.2f %% from the fleet, %d observations, outlier with probability %.3f",
                m.machine.c_str(), 100.0 * m.effect, 100.0 * m.std_dev, m.observations, m.outlier);
    if (const auto next = model.predict(m.machine, o.material, o.tool))
      std::printf("; next cut Ktc %.1f +- %.1f N/mm2%s", next->value / units::N_PER_MM2,
                  next->std_dev / units::N_PER_MM2, next->own > 0 ? "" : " (no cut of its own)");
    std::printf("%s\n", m.outlier > 0.5 ? (": " + m.meaning()).c_str() : "");
  }
}

}  // namespace

void addFleetCommands(DatabaseCommands& commands) {
  DatabaseOptions& o = commands.options();
  const CommandOptions sent = commands.add("push", "sends the records that a fleet's server does not have",
                                           [](const DatabaseOptions& given) { transfer(given, true); });
  sent.option("URL", o.other, "postgresql://USER@HOST/DATABASE").required();
  sent.flag("--all", o.all, "sends everything again, for a server restored from an older copy");
  const CommandOptions fetched =
      commands.add("pull", "fetches the records of the shop's other machines from a fleet's server",
                   [](const DatabaseOptions& given) { transfer(given, false); });
  fetched.option("URL", o.other, "postgresql://USER@HOST/DATABASE").required();
  commands.add("migrate", "DATABASE is a server: creates its tables, or updates older ones", migrate);
  const CommandOptions enrolled =
      commands.add("enrol", "DATABASE is a server: gives a machine its login", enrolOne);
  enrolled.option("MACHINE", o.other, "name of the machine").required();
  enrolled.option("--shop", o.shop, "name of the shop, whose machines read each other's records").required();
  enrolled.option("--login", o.login, "login at the server (default: the machine's name)");
  enrolled.option("--password-file", o.password_file, "file with its password (default: unchanged)");
  commands.add("members", "DATABASE is a server: lists its machines and how far behind each is", members);
  const CommandOptions learned = commands.add(
      "fleet", "compares the machines of these records and prints which deviate", compareMachines);
  learned.option("--tool", o.tool, "name of the tool of the next cut");
  learned.option("--material", o.material, "material of the next cut");
}

}  // namespace smartmill::loadmeter
