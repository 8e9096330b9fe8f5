#include "commands/coefficients_results.h"

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

void printCoefficients(const CuttingCoefficients& value, const CuttingCoefficients& std_dev) {
  for (const CuttingKey& k : cuttingKeys()) {
    const double v = value.*k.coefficient, s = std_dev.*k.coefficient;
    const std::string key = k.key;
    const std::string name = key.substr(0, key.find('_'));
    const char* unit = k.unit == units::N_PER_MM2 ? "N/mm2" : "N/mm";
    if (std::isfinite(v)) {
      std::printf("  %s %10.4f +- %8.4f %s\n", name.c_str(), v / k.unit, s / k.unit, unit);
    }
  }
}

void writeSection(const std::string& file, const CuttingCoefficients& value,
                  const CuttingCoefficients& std_dev) {
  if (file.empty()) return;
  std::ofstream stream(file);
  stream << cuttingSection(value, std_dev);
  stream.close();
  if (!stream) throw Error(file + ": cannot be written");
}

void storeRecord(const CoefficientOptions& o, CoefficientRecord record) {
  if (o.database.empty()) return;
  if (!o.tool.empty()) record.set.tool = o.tool;
  if (!o.material.empty()) record.set.material = o.material;
  record.rake = units::radFromDeg(o.rake);
  record.bag = o.source_path;
  record.machine = o.parameters.machine;
  const bool is_new = CoefficientDatabase(o.database).add(record);
  std::printf("  %s: %s\n", o.database.c_str(), is_new ? "added" : "exists already");
}

void storeCuts(const CoefficientOptions& o, std::vector<CoefficientRecord> cuts) {
  if (o.database.empty() || !o.parameters.keep_cuts) return;
  for (CoefficientRecord& cut : cuts) {
    cut.rake = units::radFromDeg(o.rake);
    cut.bag = o.source_path;
    cut.machine = o.parameters.machine;
  }
  std::printf("  %s: %zu of %zu cuts new\n", o.database.c_str(), CoefficientDatabase(o.database).add(cuts),
              cuts.size());
}

void printLoad(const CoefficientSet& found) {
  std::printf("from the load meter in %d cuts:\n", found.tests);
  printCoefficients(found.value, found.std_dev);
  if (std::isfinite(found.friction_viscous)) {
    std::printf("  friction found in the air cuts: %.4e Nm s/rad viscous, %.4f Nm Coulomb\n",
                found.friction_viscous, found.friction_coulomb);
  } else {
    std::printf("  friction: the model's (no air cuts)\n");
  }
}

void storeInspections(const CoefficientOptions& o, const MachineModel& model,
                      const std::vector<InspectionResult>& inspected) {
  if (inspected.empty()) return;
  const CoefficientDatabase database(o.database);
  std::vector<InspectionRecord> records;
  for (const InspectionResult& one : inspected) {
    if (!one.refusal.empty()) {
      std::fprintf(stderr, "%s: inspection refused: %s\n", o.program.c_str(), one.refusal.c_str());
      continue;
    }
    InspectionRecord& record = records.emplace_back(one.record);
    record.machine = o.parameters.machine;
    record.bag = o.source_path;
    setDeflection(one.condition, model, database, &record);
  }
  const std::size_t added = database.evidence().add(records);
  if (!o.database.empty())
    std::printf("  %s: %zu of %zu inspected dimensions new\n", o.database.c_str(), added, records.size());
}

void printTerms(const CoefficientOptions& o, const LoadRecordResult& found) {
  if (o.spindle_uncertainty) {
    std::printf("  with the stated uncertainty of the spindle; load-meter bandwidth %.4f Hz\n",
                found.bandwidth);
  }
  std::string terms;
  for (const std::string& term : found.terms) terms += (terms.empty() ? "" : ", ") + term;
  if (terms.empty()) terms = "none";
  std::printf(
      "  noise %.4f mV; records disagree by %.4f %% (chi2 %.1f per degree of freedom); added by evidence: "
      "%s\n",
      1e3 * found.noise, 100.0 * found.disagreement, found.misfit, terms.c_str());
  if (found.friction.breakaway != 0.0) {
    std::printf("  Stribeck friction %.4f Nm x exp(-(n / %.1f rpm)^2)\n", found.friction.breakaway,
                units::rpmFromRadPerSec(found.friction.stribeck_speed));
  }
  if (found.friction.cold_ratio != 0.0) {
    std::printf("  warm-up: friction x (1 + %.3f exp(-t / %.0f s))\n", found.friction.cold_ratio,
                found.friction.warmup_time);
  }
  if (found.edge_growth != 0.0)
    std::printf("  Kte x (1 + %.4f per minute of cut)\n", 60.0 * found.edge_growth);
  if (found.runout != 0.0) {
    std::printf("  runout %.2f um at %.1f deg\n", found.runout / units::UM,
                units::degFromRad(found.runout_angle));
  }
  if (!o.spindle_uncertainty && !found.terms.empty() && found.terms.back() == "load-meter lag") {
    std::printf("  load-meter bandwidth %.4f Hz\n", found.bandwidth);
  }
}

CoefficientRecord recordOf(const Campaign& campaign, const MachineModel& model) {
  CoefficientRecord r;
  if (model.tool) {
    r.teeth = model.tool->teeth;
    r.diameter = model.tool->diameter;
    r.helix = model.tool->helix;
  }
  r.cutting_speed = r.feed_per_tooth = r.axial_depth = r.entry = r.exit = r.edge_age = 0.0;
  double count = 0.0;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    count += 1.0;
    if (model.tool) r.cutting_speed += test.spindle_speed * model.tool->radius();
    r.feed_per_tooth += test.engagement->feed_per_tooth;
    r.axial_depth += test.engagement->axial_depth;
    r.entry += test.engagement->entry;
    r.exit += test.engagement->exit;
    r.edge_age += test.cut_time_before.value_or(NAN);
    r.set.stamp = std::max(r.set.stamp, test.start_time.value_or(0.0));
  }
  for (double* mean : {&r.cutting_speed, &r.feed_per_tooth, &r.axial_depth, &r.entry, &r.exit, &r.edge_age}) {
    *mean /= count;
  }
  return r;
}

}  // namespace smartmill::loadmeter
