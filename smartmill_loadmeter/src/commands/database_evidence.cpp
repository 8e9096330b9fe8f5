#include <cstdio>
#include <filesystem>

#include "commands/database_commands.h"
#include "smartmill_core/error.h"
#include "smartmill_loadmeter/database/causes.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/database/fleet.h"

namespace smartmill::loadmeter {
namespace {

template <typename Record>
void addAs(const DatabaseOptions& o, std::vector<Record> records) {
  for (Record& r : records) r.machine = o.machine;
  std::printf("%zu new of %zu\n", CoefficientDatabase(o.file).evidence().add(records), records.size());
}

void keep(const DatabaseOptions& o) {
  if (std::filesystem::path(o.other).extension() == ".csv") {
    addAs(o, readHealth(o.other));
  } else {
    addAs(o, std::vector<ModelImprovement>{readImprovement(o.other, o.campaign)});
  }
}

void health(const DatabaseOptions& o) {
  requireExists(o.file);
  for (const HealthRecord& r : CoefficientDatabase(o.file).evidence().health()) {
    if (!o.machine.empty() && r.machine != o.machine) continue;
    std::printf("%s: %s, %s: %.5g -> %.5g in %.2f days, %.1f deviations%s\n",
                r.machine.empty() ? "-" : r.machine.c_str(), r.measured.c_str(), r.quantity.c_str(), r.first,
                r.now, r.days, r.deviations, r.drifted > 0.0 ? "  DRIFT" : "");
  }
}

void improvements(const DatabaseOptions& o) {
  requireExists(o.file);
  for (const ModelImprovement& i : CoefficientDatabase(o.file).evidence().improvements()) {
    if (!o.machine.empty() && i.machine != o.machine) continue;
    std::printf("%s: %s, gap %.4g -> %.4g, held out %.4g -> %.4g, stamp %.0f s\n",
                i.machine.empty() ? "-" : i.machine.c_str(), i.verdict.c_str(), i.fit_before, i.fit_after,
                i.heldout_before, i.heldout_after, i.stamp);
    for (const FoundCause& cause : causesOf(i)) std::printf("  %s\n", cause.text().c_str());
    if (!i.asked.empty()) std::printf("  suggested test: %s\n", i.asked.c_str());
  }
}

void proposals(const DatabaseOptions& o) {
  requireExists(o.file);
  const auto improvements = CoefficientDatabase(o.file).evidence().improvements();
  const FleetCauses fleet = fleetCauses(improvements, o.machine);
  if (fleet.explained == 0) throw Error(withoutPassword(o.file) + ": no explanation of another machine");
  std::printf("# %zu machines explained; prior odds of any cause that none of them has: %.3g\n",
              fleet.explained, fleet.other_odds);
  int number = 0;
  for (const Proposal& p : proposalsFor(o.machine, improvements)) {
    std::printf("%d. %s: expected information %.3f nat\n", ++number, p.test.c_str(), p.information);
    for (const std::string& reason : p.reasons) std::printf("     %s\n", reason.c_str());
  }
  if (number == 0)
    std::printf("no test to propose: no known cause of the other machines is open for this one\n");
  if (!o.prior.empty()) writeCauseOdds(oddsOf(fleet), o.prior);
}

}  // namespace

void addEvidenceCommands(DatabaseCommands& commands) {
  DatabaseOptions& o = commands.options();
  const CommandOptions keep_command =
      commands.add("keep", "adds a report of `explain`, or a CSV that `health -o` wrote", keep);
  keep_command.option("FILE", o.other, "folder of the report or report.json; or a .csv of health").required();
  keep_command.option("--machine", o.machine, "name of the machine").required();
  keep_command.option("--campaign", o.campaign,
                      "folder of the explained campaign, source of the tests' conditions");
  const CommandOptions health_command =
      commands.add("health", "prints the spindles' health, oldest first", health);
  const CommandOptions improvements_command = commands.add(
      "improvements", "prints the effects that explanations found, with the evidence", improvements);
  for (const CommandOptions* command : {&health_command, &improvements_command})
    command->option("--machine", o.machine, "of this machine only");
  const CommandOptions proposals_command =
      commands.add("proposals", "proposes tests for the causes that other machines have", proposals);
  proposals_command.option("MACHINE", o.machine, "name of the machine, assumed to match its model until now")
      .required();
  proposals_command.option("--prior", o.prior, "FILE to write: odds of each effect, for `explain --prior`");
}

}  // namespace smartmill::loadmeter
