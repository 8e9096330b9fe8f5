#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/database/oblique.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

struct Options {
  std::string file, tool, material, other;
  double cutting_speed = NAN, feed = NAN, diameter = NAN, helix = NAN, rake = NAN, age = NAN;
};

void mustExist(const std::string& file) {
  if (!std::filesystem::exists(file)) throw Error(file + ": cannot be read");
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

void find(const Options& o) {
  mustExist(o.file);
  CoefficientQuery query;
  query.tool = o.tool;
  query.material = o.material;
  query.cutting_speed = o.cutting_speed * units::M_PER_MIN;
  query.feed_per_tooth = o.feed * units::MM;
  query.diameter = o.diameter * units::MM;
  query.helix = units::radFromDeg(o.helix);
  query.rake = units::radFromDeg(o.rake);
  query.edge_age = 60.0 * o.age;
  const CoefficientDatabase database(o.file);
  const auto found = database.estimate(query);
  if (!found) {
    throw Error(o.file + ": nothing for '" + o.tool + "' in '" + o.material +
                "'; known: " + database.contents());
  }
  std::printf("# from %d records, the nearest '%s' in '%s' at distance %.2f%s\n%s", found->records,
              found->set.tool.c_str(), found->set.material.c_str(), found->nearest,
              found->other_tool ? " (other tools only)" : "",
              cuttingSection(found->set.value, found->set.std_dev).c_str());
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

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("What a machine has identified: the database of cutting coefficients.");
  Options o;
  app.add_option("DATABASE", o.file, "SQLite file of the machine")->required();
  app.require_subcommand(1);
  const auto pair = [&](CLI::App* command) {
    command->add_option("--tool", o.tool, "name of the tool (default: any)");
    command->add_option("--material", o.material, "workpiece material (default: any)");
  };
  CLI::App* list_command = app.add_subcommand("list", "prints every identification, oldest first");
  pair(list_command);
  CLI::App* find_command = app.add_subcommand(
      "find", "best knowledge for a cut, uncertainty growing with distance from what was tried");
  pair(find_command);
  find_command->add_option("--cutting-speed", o.cutting_speed, "[m/min]");
  find_command->add_option("--feed-per-tooth", o.feed, "[mm]");
  find_command->add_option("--diameter", o.diameter, "[mm]");
  find_command->add_option("--helix", o.helix, "[deg]");
  find_command->add_option("--rake", o.rake, "[deg] normal rake");
  find_command->add_option("--edge-age", o.age, "[min] cutting time of the edge");
  CLI::App* predict_command = app.add_subcommand(
      "predict", "another tool's coefficients by way of shear angle, friction angle and shear stress");
  predict_command->add_option("--material", o.material, "workpiece material")->required();
  predict_command->add_option("--rake", o.rake, "[deg] normal rake")->required();
  predict_command->add_option("--helix", o.helix, "[deg]")->required();
  CLI::App* merge_command = app.add_subcommand("merge", "takes over what another machine's file has");
  merge_command->add_option("OTHER", o.other, "SQLite file")->required();
  CLI::App* export_command = app.add_subcommand("export", "writes everything as .csv or .yaml");
  export_command->add_option("FILE", o.other, "file to write")->required();
  pair(export_command);
  CLI::App* import_command = app.add_subcommand("import", "reads .csv or .yaml in");
  import_command->add_option("FILE", o.other, "file to read")->required();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    if (list_command->parsed()) list(o);
    if (find_command->parsed()) find(o);
    if (predict_command->parsed()) predictFor(o);
    if (merge_command->parsed()) {
      std::printf("%zu new\n", CoefficientDatabase(o.file).merge(o.other));
    }
    if (export_command->parsed()) {
      mustExist(o.file);
      const bool csv = isCsv(o.other);
      const auto records = CoefficientDatabase(o.file).records(o.tool, o.material);
      (csv ? exportCsv : exportYaml)(records, o.other);
      std::printf("%zu written\n", records.size());
    }
    if (import_command->parsed()) {
      const auto records = isCsv(o.other) ? importCsv(o.other) : importYaml(o.other);
      std::printf("%zu new of %zu\n", CoefficientDatabase(o.file).add(records), records.size());
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "coefficients_db: %s\n", error.what());
    return 1;
  }
  return 0;
}
