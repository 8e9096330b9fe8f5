#include <cmath>
#include <cstdio>
#include <set>

#include "commands/database_commands.h"
#include "smartmill_core/signal/machine_temperature.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/inspection/inspection_evidence.h"
#include "smartmill_loadmeter/inspection/inspection_file.h"

namespace smartmill::loadmeter {
namespace {

// Inspections of one machine, or of all.
std::vector<InspectionRecord> inspectionsOf(const CoefficientDatabase& database, const DatabaseOptions& o) {
  std::vector<InspectionRecord> records;
  for (const InspectionRecord& r : database.evidence().inspections(o.tool)) {
    if ((o.machine.empty() || r.machine == o.machine) && !(r.stamp < o.since)) records.push_back(r);
  }
  return records;
}

void printEvidence(const std::vector<InspectionRecord>& records) {
  for (const std::string& line : inspectionEvidence(records).lines()) std::printf("%s\n", line.c_str());
}

void inspect(const DatabaseOptions& o) {
  const std::vector<InspectedFeature> features = readInspection(o.other);
  CoefficientDatabase database(o.file);
  const MachineModel model = o.model.empty() ? MachineModel() : readMachineModel(o.model);
  std::vector<InspectionRecord> records;
  std::set<std::string> tools;
  for (InspectedFeature feature : features) {
    feature.record.machine = o.machine;
    feature.record.bag = o.other;
    tools.insert(feature.record.tool);
    if (const std::string why = setDeflection(feature.condition, model, database, &feature.record);
        !why.empty())
      std::fprintf(stderr, "%s: '%s': not corrected for deflection: %s\n", o.program.c_str(),
                   feature.record.condition.c_str(), why.c_str());
    records.push_back(feature.record);
  }
  std::printf("%zu new of %zu\n", database.evidence().add(records), records.size());
  DatabaseOptions selected = o;
  for (const std::string& tool : tools) {
    selected.tool = tool;
    printEvidence(inspectionsOf(database, selected));
  }
}

void inspections(const DatabaseOptions& o) {
  requireExists(o.file);
  const CoefficientDatabase database(o.file);
  const std::vector<InspectionRecord> records = inspectionsOf(database, o);
  for (const InspectionRecord& r : records) {
    std::printf("%s / %s  %s: %s along %s, %.4f mm, %+.1f +- %.1f um from nominal", r.tool.c_str(),
                r.material.c_str(), r.condition.c_str(), r.kind.c_str(), r.direction.c_str(),
                r.measured / units::MM, r.deviation() / units::UM, r.std_dev / units::UM);
    if (std::isfinite(r.deflection)) std::printf(", of it deflection %+.1f um", r.deflection / units::UM);
    if (std::isfinite(r.machine_temperature))
      std::printf(", machine at %.1f degC", r.machine_temperature - ZERO_CELSIUS);
    if (std::isfinite(r.edge_age)) std::printf(", edge age %.1f min", r.edge_age / 60.0);
    std::printf(", stamp %.3f s, %s\n", r.stamp, r.machine.empty() ? "-" : r.machine.c_str());
  }
  printEvidence(records);
}

}  // namespace

void addInspectionCommands(DatabaseCommands& commands) {
  DatabaseOptions& o = commands.options();
  const CommandOptions add = commands.add(
      "inspect", "adds measured dimensions of parts and prints what they say of tool and machine", inspect);
  add.option("FILE", o.other, "dimensions and cuts, smartmill-inspection/1").required();
  add.option("--machine", o.machine, "name of the machine");
  add.option("--model", o.model,
             "model file of the machine: slot widths are corrected for the deflection of its tool tip");
  const CommandOptions show = commands.add(
      "inspections", "prints measured dimensions of parts, with radius of the tools and thermal growth",
      inspections);
  show.option("--tool", o.tool, "name of the tool (default: any)");
  show.option("--machine", o.machine, "of this machine only");
  show.option("--since", o.since, "[s] stamp of the first inspection used, for example of a new edge");
}

}  // namespace smartmill::loadmeter
