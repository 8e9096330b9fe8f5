#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/causes.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter/database/fleet_model.h"
#include "smartmill_loadmeter/database/oblique.h"
#include "smartmill_loadmeter/database/recommend.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

struct Options {
  std::string file, tool, material, other, shop, login, password_file, machine, campaign, prior;
  bool all = false;
  double cutting_speed = NAN, feed = NAN, diameter = NAN, helix = NAN, rake = NAN, age = NAN;
};

void mustExist(const std::string& file) {
  if (!isFleet(file) && !std::filesystem::exists(file)) throw Error(file + ": cannot be read");
}

bool isCsv(const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension().string();
  if (extension == ".csv") return true;
  if (extension == ".yaml" || extension == ".yml") return false;
  throw Error(file + ": a file ending in .csv or .yaml is due");
}

void list(const Options& o) {
  mustExist(o.file);
  for (const CoefficientRecord& r : CoefficientDatabase(o.file).records(o.tool, o.material)) {
    std::printf("%s / %s  %s, %d tests, stamp %.3f s, %s", r.set.tool.c_str(), r.set.material.c_str(),
                r.set.source.c_str(), r.set.tests, r.set.stamp, r.machine.empty() ? "-" : r.machine.c_str());
    if (std::isfinite(r.cutting_speed)) std::printf(", %.1f m/min", r.cutting_speed / units::M_PER_MIN);
    std::printf("\n%s", cuttingSection(r.set.value, r.set.std_dev).c_str());
  }
}

CoefficientQuery queryOf(const Options& o) {
  CoefficientQuery query;
  query.tool = o.tool;
  query.material = o.material;
  query.cutting_speed = o.cutting_speed * units::M_PER_MIN;
  query.feed_per_tooth = o.feed * units::MM;
  query.diameter = o.diameter * units::MM;
  query.helix = units::radFromDeg(o.helix);
  query.rake = units::radFromDeg(o.rake);
  query.edge_age = 60.0 * o.age;
  return query;
}

void find(const Options& o) {
  mustExist(o.file);
  const CoefficientDatabase database(o.file);
  const auto found = database.estimate(queryOf(o));
  if (!found) {
    throw Error(o.file + ": nothing for '" + o.tool + "' in '" + o.material +
                "'; known: " + database.contents());
  }
  std::printf("# from %d records, the nearest '%s' in '%s' at distance %.2f%s\n%s", found->records,
              found->set.tool.c_str(), found->set.material.c_str(), found->nearest,
              found->other_tool ? " (other tools only)" : "",
              cuttingSection(found->set.value, found->set.std_dev).c_str());
}

void answer(const Options& o) {
  mustExist(o.file);
  const CoefficientDatabase database(o.file);
  const auto found = recommendCut(database, queryOf(o));
  if (!found) throw Error(o.file + ": nothing in '" + o.material + "'; known: " + database.contents());
  std::printf("%s\n", found->message.c_str());
  for (const WayAnswer& way : found->ways)
    std::printf("#   %s: Ktc %.1f +- %.1f N/mm2, %d records\n", nameOf(way.way),
                way.set.value.ktc / units::N_PER_MM2, way.set.std_dev.ktc / units::N_PER_MM2, way.records);
  std::printf("%s", cuttingSection(found->set.value, found->set.std_dev).c_str());
}

void predictFor(const Options& o) {
  mustExist(o.file);
  std::vector<ObliqueSet> sets;
  int without_rake = 0;
  for (const CoefficientRecord& r : CoefficientDatabase(o.file).records("", o.material)) {
    if (!std::isfinite(r.rake) || !std::isfinite(r.helix)) {
      ++without_rake;
      continue;
    }
    sets.push_back({r.rake, r.helix, r.set.value, r.set.std_dev});
  }
  if (without_rake > 0) {
    std::fprintf(stderr, "coefficients_db: %d records without rake or helix left out\n", without_rake);
  }
  const OrthogonalParameters p = semiInverse(sets);
  const ShearZone zone = p.at(units::radFromDeg(o.rake));
  const CoefficientSet k = predict(p, units::radFromDeg(o.rake), units::radFromDeg(o.helix));
  std::printf("# from %d sets: shear stress %.1f N/mm2, shear angle %.2f deg, friction angle %.2f deg\n%s",
              p.sets, zone.shear_stress / units::N_PER_MM2, units::degFromRad(zone.shear_angle),
              units::degFromRad(zone.friction_angle), cuttingSection(k.value, k.std_dev).c_str());
}

/// What is known of the cut; of a tool that has cut something its records may know rake and helix.
void cutOptions(const CommandOptions& command, Options& o) {
  command.option("--cutting-speed", o.cutting_speed, "[m/min]");
  command.option("--feed-per-tooth", o.feed, "[mm]");
  command.option("--diameter", o.diameter, "[mm]");
  command.option("--helix", o.helix, "[deg]");
  command.option("--rake", o.rake, "[deg] normal rake");
}

void progressOf(const char* verb, const FleetTransfer& done) {
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\r%zu %s", done.offered, verb);
}

void transfer(const Options& o, bool out) {
  if (out) mustExist(o.file);
  CoefficientDatabase local(o.file);
  const char* verb = out ? "sent" : "came";
  const auto progress = [&](const FleetTransfer& done) { progressOf(verb, done); };
  const FleetTransfer done = out ? push(local, o.other, progress, o.all) : pull(local, o.other, progress);
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\r");
  std::printf("%zu new of %zu %s\n", done.fresh, done.offered, verb);
}

void migrate(const Options& o) {
  const int found = migrateFleet(o.file);
  if (found == FLEET_SCHEMA) {
    std::printf("tables are of version %d already\n", found);
  } else if (found > 0) {
    std::printf("tables of version %d are of version %d now\n", found, FLEET_SCHEMA);
  } else {
    std::printf("tables of version %d made\n", FLEET_SCHEMA);
  }
}

void enrolOne(const Options& o) {
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

void members(const Options& o) {
  for (const FleetMember& m : fleetMembers(o.file)) {
    std::printf("%s of %s: %zu records", m.name.c_str(), m.shop.c_str(), m.records);
    if (std::isfinite(m.silent)) {
      std::printf(", last push %.0f s ago, %zu behind then\n", m.silent, m.behind);
    } else {
      std::printf(", no push yet\n");
    }
  }
}

template <typename Record>
void keepAs(const Options& o, std::vector<Record> records) {
  for (Record& r : records) r.machine = o.machine;
  std::printf("%zu new of %zu\n", CoefficientDatabase(o.file).add(records), records.size());
}

void keep(const Options& o) {
  if (std::filesystem::path(o.other).extension() == ".csv") {
    keepAs(o, readHealth(o.other));
  } else {
    keepAs(o, std::vector<ModelImprovement>{readImprovement(o.other, o.campaign)});
  }
}

void health(const Options& o) {
  mustExist(o.file);
  for (const HealthRecord& r : CoefficientDatabase(o.file).health()) {
    if (!o.machine.empty() && r.machine != o.machine) continue;
    std::printf("%s: %s, %s: %.5g -> %.5g in %.2f days, %.1f deviations%s\n",
                r.machine.empty() ? "-" : r.machine.c_str(), r.measured.c_str(), r.quantity.c_str(), r.first,
                r.now, r.days, r.deviations, r.drifted > 0.0 ? "  DRIFT" : "");
  }
}

void improvements(const Options& o) {
  mustExist(o.file);
  for (const ModelImprovement& i : CoefficientDatabase(o.file).improvements()) {
    if (!o.machine.empty() && i.machine != o.machine) continue;
    std::printf("%s: %s, gap %.4g -> %.4g, held out %.4g -> %.4g, stamp %.0f s\n",
                i.machine.empty() ? "-" : i.machine.c_str(), i.verdict.c_str(), i.fit_before, i.fit_after,
                i.heldout_before, i.heldout_after, i.stamp);
    for (const FoundCause& cause : causesOf(i)) std::printf("  %s\n", cause.text().c_str());
    if (!i.asked.empty()) std::printf("  would tell more: %s\n", i.asked.c_str());
  }
}

void proposals(const Options& o) {
  mustExist(o.file);
  const auto improvements = CoefficientDatabase(o.file).improvements();
  const FleetCauses fleet = fleetCauses(improvements, o.machine);
  if (fleet.explained == 0) throw Error(withoutPassword(o.file) + ": no other machine was explained yet");
  std::printf("# %zu machines explained; each cause none of them has: odds %.3g\n", fleet.explained,
              fleet.other_odds);
  int number = 0;
  for (const Proposal& p : proposalsFor(o.machine, improvements)) {
    std::printf("%d. %s: tells %.3f nat of the cause\n", ++number, p.test.c_str(), p.information);
    for (const std::string& reason : p.reasons) std::printf("     %s\n", reason.c_str());
  }
  if (number == 0) std::printf("nothing to check: this machine has what the others were found to have\n");
  if (!o.prior.empty()) writeCauseOdds(oddsOf(fleet), o.prior);
}

/// Commands about what is kept beside coefficients.
class EvidenceCommands {
 public:
  EvidenceCommands(CommandLine& line, Options& o)
      : keep_(line.command("keep", "takes a report of `explain`, or what `hammer health -o` wrote, in")),
        health_(line.command("health", "what the spindles' health was, oldest first")),
        improvements_(line.command("improvements", "what explanations found, with the evidence")),
        proposals_(line.command("proposals", "what a machine should check, as others have it")) {
    proposals_.option("MACHINE", o.machine, "whose model is believed until now").required();
    proposals_.option("--prior", o.prior, "FILE to write: odds of each effect, for `explain --prior`");
    keep_.option("FILE", o.other, "folder of the report or report.json; or a .csv of health").required();
    keep_.option("--machine", o.machine, "whose it is").required();
    keep_.option("--campaign", o.campaign, "folder that was explained: tells the tests' conditions");
    for (const CommandOptions* command : {&health_, &improvements_})
      command->option("--machine", o.machine, "of this machine only");
  }
  void run(const Options& o) const {
    if (keep_.parsed()) keep(o);
    if (health_.parsed()) health(o);
    if (improvements_.parsed()) improvements(o);
    if (proposals_.parsed()) proposals(o);
  }

 private:
  CommandOptions keep_, health_, improvements_, proposals_;
};

// What machines share and what is each one's own, from Ktc; then the next cut of each.
void learn(const Options& o) {
  mustExist(o.file);
  const auto records = CoefficientDatabase(o.file).records("", "");
  const FleetModel model(observationsOf(records, &CuttingCoefficients::ktc));
  const FleetDeviations s = model.deviations();
  std::printf(
      "# Ktc scatters by %.2f %% between machines, %.2f %% between batches, %.2f %% between tools, %.2f %% "
      "from cut to cut\n",
      100.0 * s.machine, 100.0 * s.batch, 100.0 * s.tool, 100.0 * s.noise);
  for (const MachineEffect& m : model.machines()) {
    std::printf("%s: %+.2f +- %.2f %% beside the fleet, from %d, odd with probability %.3f",
                m.machine.c_str(), 100.0 * m.effect, 100.0 * m.std_dev, m.observations, m.odd);
    if (const auto next = model.predict(m.machine, o.material, o.tool))
      std::printf("; next cut Ktc %.1f +- %.1f N/mm2%s", next->value / units::N_PER_MM2,
                  next->std_dev / units::N_PER_MM2, next->own > 0 ? "" : " (it has none)");
    std::printf("%s\n", m.odd > 0.5 ? (": " + m.meaning()).c_str() : "");
  }
}

/// Commands about a fleet's server.
class FleetCommands {
 public:
  FleetCommands(CommandLine& line, Options& o)
      : push_(line.command("push", "sends what a fleet's server has not got yet")),
        pull_(line.command("pull", "takes over what the shop's other machines sent to a fleet's server")),
        migrate_(line.command("migrate",
                              "DATABASE is a server: makes its tables, or brings older ones up to date")),
        enrol_(line.command("enrol", "DATABASE is a server: gives a machine its login")),
        members_(line.command("members", "DATABASE is a server: its machines, and how far behind each is")),
        learn_(line.command("fleet", "what the machines of these records share, and which is odd")) {
    learn_.option("--tool", o.tool, "of the next cut");
    learn_.option("--material", o.material, "of the next cut");
    push_.option("URL", o.other, "postgresql://USER@HOST/DATABASE").required();
    push_.flag("--all", o.all, "everything anew, for a server restored from an older copy");
    pull_.option("URL", o.other, "postgresql://USER@HOST/DATABASE").required();
    enrol_.option("MACHINE", o.other, "name of the machine").required();
    enrol_.option("--shop", o.shop, "whose machines read each other's records").required();
    enrol_.option("--login", o.login, "of the server (default: the machine's name)");
    enrol_.option("--password-file", o.password_file, "its password; default: left as it is");
  }
  void run(const Options& o) const {
    if (push_.parsed()) transfer(o, true);
    if (pull_.parsed()) transfer(o, false);
    if (migrate_.parsed()) migrate(o);
    if (enrol_.parsed()) enrolOne(o);
    if (members_.parsed()) members(o);
    if (learn_.parsed()) learn(o);
  }

 private:
  CommandOptions push_, pull_, migrate_, enrol_, members_, learn_;
};

}  // namespace

int main(int argc, char** argv) {
  CommandLine line("What a machine has identified: the database of cutting coefficients.");
  Options o;
  line.option("DATABASE", o.file,
              "SQLite file of the machine; or a fleet's server, postgresql://USER@HOST/DATABASE")
      .required();
  const auto pair = [&](const CommandOptions& command) {
    command.option("--tool", o.tool, "name of the tool (default: any)");
    command.option("--material", o.material, "workpiece material (default: any)");
  };
  const CommandOptions list_command = line.command("list", "prints every identification, oldest first");
  pair(list_command);
  const CommandOptions find_command =
      line.command("find", "best knowledge for a cut, uncertainty growing with distance from what was tried");
  pair(find_command);
  cutOptions(find_command, o);
  find_command.option("--edge-age", o.age, "[min] cutting time of the edge");
  const CommandOptions predict_command = line.command(
      "predict", "another tool's coefficients by way of shear angle, friction angle and shear stress");
  predict_command.option("--material", o.material, "workpiece material").required();
  predict_command.option("--rake", o.rake, "[deg] normal rake").required();
  predict_command.option("--helix", o.helix, "[deg]").required();
  const CommandOptions answer_command = line.command(
      "answer",
      "what to cut a material with this tool by, though they may never have met, and how sure it is");
  answer_command.option("--tool", o.tool, "name of the tool").required();
  answer_command.option("--material", o.material, "workpiece material").required();
  cutOptions(answer_command, o);
  const CommandOptions merge_command = line.command("merge", "takes over what another machine's file has");
  merge_command.option("OTHER", o.other, "SQLite file").required();
  const CommandOptions export_command = line.command("export", "writes everything as .csv or .yaml");
  export_command.option("FILE", o.other, "file to write").required();
  pair(export_command);
  const CommandOptions import_command = line.command("import", "reads .csv or .yaml in");
  import_command.option("FILE", o.other, "file to read").required();
  const EvidenceCommands evidence_commands(line, o);
  const FleetCommands fleet_commands(line, o);
  return runProgram(line, argc, argv, [&] {
    evidence_commands.run(o);
    fleet_commands.run(o);
    if (list_command.parsed()) list(o);
    if (find_command.parsed()) find(o);
    if (predict_command.parsed()) predictFor(o);
    if (answer_command.parsed()) answer(o);
    if (merge_command.parsed()) {
      std::printf("%zu new\n", CoefficientDatabase(o.file).merge(o.other));
    }
    if (export_command.parsed()) {
      mustExist(o.file);
      const bool csv = isCsv(o.other);
      const auto records = CoefficientDatabase(o.file).records(o.tool, o.material);
      (csv ? exportCsv : exportYaml)(records, o.other);
      std::printf("%zu written\n", records.size());
    }
    if (import_command.parsed()) {
      const auto records = isCsv(o.other) ? importCsv(o.other) : importYaml(o.other);
      std::printf("%zu new of %zu\n", CoefficientDatabase(o.file).add(records), records.size());
    }
  });
}
