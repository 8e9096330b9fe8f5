#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "commands/database_commands.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/commands.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter/database/oblique.h"
#include "smartmill_loadmeter/database/recommend.h"

namespace smartmill::loadmeter {

void requireExists(const std::string& file) {
  if (!isServerUrl(file) && !std::filesystem::exists(file)) throw Error(file + ": cannot be read");
}

namespace {

bool isCsv(const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension().string();
  if (extension == ".csv") return true;
  if (extension == ".yaml" || extension == ".yml") return false;
  throw Error(file + ": expected a file ending in .csv or .yaml");
}

void list(const DatabaseOptions& o) {
  requireExists(o.file);
  for (const CoefficientRecord& r : CoefficientDatabase(o.file).records(o.tool, o.material)) {
    std::printf("%s / %s  %s, %d tests, stamp %.3f s, %s", r.set.tool.c_str(), r.set.material.c_str(),
                r.set.source.c_str(), r.set.tests, r.set.stamp, r.machine.empty() ? "-" : r.machine.c_str());
    if (std::isfinite(r.cutting_speed)) std::printf(", %.1f m/min", r.cutting_speed / units::M_PER_MIN);
    std::printf("\n%s", cuttingSection(r.set.value, r.set.std_dev).c_str());
  }
}

CoefficientQuery queryOf(const DatabaseOptions& o) {
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

void find(const DatabaseOptions& o) {
  requireExists(o.file);
  const CoefficientDatabase database(o.file);
  const auto found = database.estimate(queryOf(o));
  if (!found) {
    throw Error(o.file + ": no records for '" + o.tool + "' in '" + o.material +
                "'; known: " + database.contents());
  }
  std::printf("# from %d records, the nearest '%s' in '%s' at distance %.2f%s\n%s", found->records,
              found->set.tool.c_str(), found->set.material.c_str(), found->nearest,
              found->other_tool ? " (other tools only)" : "",
              cuttingSection(found->set.value, found->set.std_dev).c_str());
}

void answer(const DatabaseOptions& o) {
  requireExists(o.file);
  const CoefficientDatabase database(o.file);
  const auto found = recommendCut(database, queryOf(o));
  if (!found) throw Error(o.file + ": no records in '" + o.material + "'; known: " + database.contents());
  std::printf("%s\n", found->message.c_str());
  for (const MethodEstimate& method : found->estimates)
    std::printf("#   %s: Ktc %.1f +- %.1f N/mm2, %d records\n", nameOf(method.method),
                method.set.value.ktc / units::N_PER_MM2, method.set.std_dev.ktc / units::N_PER_MM2,
                method.records);
  std::printf("%s", cuttingSection(found->set.value, found->set.std_dev).c_str());
}

void predictFor(const DatabaseOptions& o) {
  requireExists(o.file);
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
    std::fprintf(stderr, "%s: %d records without rake or helix ignored\n", o.program.c_str(), without_rake);
  }
  const OrthogonalParameters p = semiInverse(sets);
  const ShearZone zone = p.at(units::radFromDeg(o.rake));
  const CoefficientSet k = predict(p, units::radFromDeg(o.rake), units::radFromDeg(o.helix));
  std::printf("# from %d sets: shear stress %.1f N/mm2, shear angle %.2f deg, friction angle %.2f deg\n%s",
              p.sets, zone.shear_stress / units::N_PER_MM2, units::degFromRad(zone.shear_angle),
              units::degFromRad(zone.friction_angle), cuttingSection(k.value, k.std_dev).c_str());
}

void merge(const DatabaseOptions& o) {
  std::printf("%zu new\n", CoefficientDatabase(o.file).merge(o.other));
}

void exportAll(const DatabaseOptions& o) {
  requireExists(o.file);
  const bool csv = isCsv(o.other);
  const auto records = CoefficientDatabase(o.file).records(o.tool, o.material);
  (csv ? exportCsv : exportYaml)(records, o.other);
  std::printf("%zu written\n", records.size());
}

void importAll(const DatabaseOptions& o) {
  const auto records = isCsv(o.other) ? importCsv(o.other) : importYaml(o.other);
  std::printf("%zu new of %zu\n", CoefficientDatabase(o.file).add(records), records.size());
}

/// Condition of the cut; rake and helix may also come from the tool's records.
void cutOptions(const CommandOptions& command, DatabaseOptions& o) {
  command.option("--cutting-speed", o.cutting_speed, "cutting speed [m/min]");
  command.option("--feed-per-tooth", o.feed, "feed per tooth [mm]");
  command.option("--diameter", o.diameter, "diameter of the tool [mm]");
  command.option("--helix", o.helix, "helix angle [deg]");
  command.option("--rake", o.rake, "normal rake [deg]");
}

/// Selection of records.
void pairOptions(const CommandOptions& command, DatabaseOptions& o) {
  command.option("--tool", o.tool, "name of the tool (default: any)");
  command.option("--material", o.material, "workpiece material (default: any)");
}

std::function<int()> declare(CommandLine& line) {
  DatabaseCommands commands(line);
  DatabaseOptions& o = commands.options();
  o.program = line.program();
  line.option("DATABASE", o.file,
              "SQLite file of the machine; or a fleet's server, postgresql://USER@HOST/DATABASE")
      .required();
  pairOptions(commands.add("list", "prints every identification, oldest first", list), o);
  const CommandOptions found = commands.add(
      "find",
      "prints the best coefficients for a cut; their uncertainty grows with the distance from past cuts",
      find);
  pairOptions(found, o);
  cutOptions(found, o);
  found.option("--edge-age", o.age, "cutting time of the edge [min]");
  const CommandOptions predicted = commands.add(
      "predict", "predicts another tool's coefficients from shear angle, friction angle and shear stress",
      predictFor);
  predicted.option("--material", o.material, "workpiece material").required();
  predicted.option("--rake", o.rake, "normal rake [deg]").required();
  predicted.option("--helix", o.helix, "helix angle [deg]").required();
  const CommandOptions answered = commands.add(
      "answer", "recommends coefficients for a tool in a material, even if untried, with their uncertainty",
      answer);
  answered.option("--tool", o.tool, "name of the tool").required();
  answered.option("--material", o.material, "workpiece material").required();
  cutOptions(answered, o);
  commands.add("merge", "adds the records of another machine's file", merge)
      .option("OTHER", o.other, "SQLite file")
      .required();
  const CommandOptions exported = commands.add("export", "writes all records as .csv or .yaml", exportAll);
  exported.option("FILE", o.other, "file to write").required();
  pairOptions(exported, o);
  commands.add("import", "adds the records of a .csv or .yaml", importAll)
      .option("FILE", o.other, "file to read")
      .required();
  addEvidenceCommands(commands);
  addInspectionCommands(commands);
  addFleetCommands(commands);
  return commands.body();
}

}  // namespace

Command databaseCommand() {
  Command command("database", "queries and exchanges a machine's database of cutting coefficients");
  command.tool = "coefficients_db";
  command.description = "The database of cutting coefficients that a machine has identified.";
  command.examples = {
      {"machine.sqlite list", "every identification, oldest first"},
      {"machine.sqlite find --tool endmill --material steel --feed-per-tooth 0.1", "coefficients for a cut"},
      {"machine.sqlite inspect parts.yaml --model mill.yaml",
       "measured dimensions of parts, as evidence of tool and machine"},
      {"machine.sqlite export records.csv --material steel", "records as a table"}};
  command.files = {{"DATABASE", "SQLite file, or a fleet's server (postgresql://USER@HOST/DATABASE)"},
                   {"FILE", "of `inspect`: smartmill-inspection/1, see docs/formats.md"}};
  command.declare = declare;
  return command;
}

}  // namespace smartmill::loadmeter
