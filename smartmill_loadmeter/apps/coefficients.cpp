#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "../src/node/bag_identification.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"
#include "smartmill_ros/parameter_options.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

struct Options {
  std::string source_path, source, model, means = "all", output, database;
  NodeParameters parameters;
  std::string tool, material;
  double rake = NAN, depth_percent = 0.0, runout_um = 0.0;
  bool spindle_uncertainty = false, plain_friction = false, forces = false;
};

const char* practice(Means means) {
  return means == Means::all ? "means of all samples in cut" : "means over whole revolutions";
}

void print(const CuttingCoefficients& value, const CuttingCoefficients& std_dev) {
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

void write(const std::string& file, const CuttingCoefficients& value, const CuttingCoefficients& std_dev) {
  if (file.empty()) return;
  std::ofstream stream(file);
  stream << cuttingSection(value, std_dev);
  stream.close();
  if (!stream) throw Error(file + ": cannot be written");
}

void keep(const Options& o, CoefficientRecord record) {
  if (o.database.empty()) return;
  if (!o.tool.empty()) record.set.tool = o.tool;
  if (!o.material.empty()) record.set.material = o.material;
  record.rake = units::radFromDeg(o.rake);
  record.bag = o.source_path;
  record.machine = o.parameters.machine;
  const bool is_new = CoefficientDatabase(o.database).add(record);
  std::printf("  %s: %s\n", o.database.c_str(), is_new ? "kept" : "was there already");
}

/// Every cut of a bag.
void keepCuts(const Options& o, std::vector<CoefficientRecord> cuts) {
  if (o.database.empty() || !o.parameters.keep_cuts) return;
  for (CoefficientRecord& cut : cuts) {
    cut.rake = units::radFromDeg(o.rake);
    cut.bag = o.source_path;
    cut.machine = o.parameters.machine;
  }
  std::printf("  %s: %zu of %zu cuts new\n", o.database.c_str(), CoefficientDatabase(o.database).add(cuts),
              cuts.size());
}

/// Means of the cuts of a campaign.
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

void fromForce(const Options& o, const Campaign& campaign, const MachineModel& model) {
  const Means chosen = o.means == "all" ? Means::all : Means::revolutions;
  for (const Means means : {chosen, chosen == Means::all ? Means::revolutions : Means::all}) {
    const IdentifiedCoefficients found = identifyFromForceRecords(campaign, model, means);
    std::printf("%sfrom the forces of %d cuts, %s (unweighted fit):\n",
                means == chosen ? "" : "\nfor comparison, ", found.tests, practice(means));
    print(found.value, found.std_dev);
    std::printf("  R2 of the mean forces: x %.4f, y %.4f, z %.4f\n", found.r_squared_x, found.r_squared_y,
                found.r_squared_z);
    if (means != chosen) continue;
    write(o.output, found.value, found.std_dev);
    CoefficientRecord record = recordOf(campaign, model);
    record.set.source = "force";
    record.set.tests = found.tests;
    record.set.value = found.value;
    record.set.std_dev = found.std_dev;
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = i; j < 6; ++j) {
        record.covariance[CoefficientRecord::covarianceIndex(i, j)] =
            found.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      }
    }
    keep(o, record);
  }
}

void fromLoad(const Options& o, const CoefficientSet& found) {
  std::printf("from the load meter in %d cuts:\n", found.tests);
  print(found.value, found.std_dev);
  if (std::isfinite(found.friction_viscous)) {
    std::printf("  friction found in the air cuts: %.4e Nm s/rad viscous, %.4f Nm Coulomb\n",
                found.friction_viscous, found.friction_coulomb);
  } else {
    std::printf("  friction: the model's (no air cuts)\n");
  }
  write(o.output, found.value, found.std_dev);
}

void printTerms(const Options& o, const LoadRecordResult& found) {
  if (o.spindle_uncertainty) {
    std::printf("  with the stated uncertainty of the spindle; load meter's bandwidth %.4f Hz\n",
                found.bandwidth);
  }
  std::string terms;
  for (const std::string& term : found.terms) terms += (terms.empty() ? "" : ", ") + term;
  if (terms.empty()) terms = "none";
  std::printf(
      "  noise %.4f mV; records disagree by %.4f %% (chi2 %.1f a degree of freedom); added by evidence: %s\n",
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
  if (!o.spindle_uncertainty && !found.terms.empty() && found.terms.back() == "load meter's lag") {
    std::printf("  load meter's bandwidth %.4f Hz\n", found.bandwidth);
  }
}

void run(const Options& o) {
  if (!std::filesystem::exists(o.source_path)) throw Error(o.source_path + ": cannot be read");
  if (std::filesystem::path(o.source_path).extension() == ".bag") {
    if (o.source == "force")
      throw Error(o.source_path + ": a bag gives coefficients from the load meter only");
    const NodeParameters& parameters = o.parameters;
    parameters.validate();
    const std::string model_file = o.model.empty() ? parameters.model : o.model;
    if (model_file.empty()) throw Error(o.source_path + ": a bag needs the machine's model (--model)");
    const bool terminal = isatty(STDERR_FILENO);
    const auto progress = [terminal](double share) {
      if (terminal) std::fprintf(stderr, "\rreading %3.0f %%%s", 100.0 * share, share >= 1.0 ? "\n" : "");
    };
    std::vector<CoefficientRecord> cuts;
    BagListeners listeners;
    listeners.progress = progress;
    listeners.cut = [&](const CoefficientRecord& cut) { cuts.push_back(cut); };
    if (o.forces) {
      listeners.force = [](const ForceEstimate& f) {
        std::printf("%s: %s\n", f.name.c_str(), f.text().c_str());
      };
    }
    const auto results = identifyFromBag(o.source_path, readMachineModel(model_file), parameters, listeners);
    keepCuts(o, std::move(cuts));
    for (const IdentifyResult& result : results) {
      if (result.code != IdentifyResult::Code::ok) throw Error(o.source_path + ": " + result.message);
      std::printf("%s\n", result.message.c_str());
      fromLoad(o, result.coefficients);
      keep(o, result.record);
    }
    return;
  }
  const Campaign campaign = readCampaign(o.source_path);
  const MachineModel model = readMachineModel(o.model.empty() ? campaign.modelPath() : o.model);
  if (o.source != "load_meter") {
    fromForce(o, campaign, model);
    return;
  }
  LoadRecordOptions options;
  options.spindle_uncertainty = o.spindle_uncertainty;
  options.choose_terms = !o.plain_friction;
  options.runout_uncertainty = o.runout_um * units::UM;
  options.depth_uncertainty = o.depth_percent / 100.0;
  const LoadRecordResult found = identifyFromLoadRecords(campaign, model, options);
  for (const std::string& note : found.notes) std::fprintf(stderr, "coefficients: %s\n", note.c_str());
  fromLoad(o, found.set);
  printTerms(o, found);
  CoefficientRecord record = recordOf(campaign, model);
  const double stamp = record.set.stamp;
  record.set = found.set;
  record.set.stamp = stamp;
  const auto index = CoefficientRecord::covarianceIndex;
  record.covariance[index(0, 0)] = found.set.std_dev.ktc * found.set.std_dev.ktc;
  record.covariance[index(0, 3)] = found.covariance_tc_te;
  record.covariance[index(3, 3)] = found.set.std_dev.kte * found.set.std_dev.kte;
  keep(o, record);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Cutting coefficients with standard deviations, from the force records or the load meter of a campaign "
      "(a folder with campaign.yaml) or from the load meter in a recorded bag.");
  Options o;
  line.option("SOURCE", o.source_path, "campaign folder, or a bag").required();
  line.option("--source", o.source, "what to use (default: force of a campaign, load_meter of a bag)")
      .oneOf({"force", "load_meter"});
  line.option("--model", o.model, "model file (default: the campaign's); its cutting section is not used");
  line.option("--means", o.means, "force: means of all samples in cut, or over whole revolutions")
      .showDefault()
      .oneOf({"all", "revolutions"});
  line.flag("--spindle-uncertainty", o.spindle_uncertainty,
            "load_meter of a campaign: the model's stated uncertainty of the spindle holds for "
            "load_meter_v_per_w and the bandwidth too (default: both exact)");
  line.option("--depth-uncertainty", o.depth_percent,
              "[%] load_meter of a campaign: standard deviation of the axial depth, common to all cuts")
      .within(0.0, 100.0);
  line.option("--runout-uncertainty", o.runout_um,
              "[um] load_meter of a campaign: standard deviation of the cutter axis' offset")
      .within(0.0, 100.0);
  line.flag("--forces", o.forces,
            "of a bag: each cut's force by all that was measured of it (force/estimate)");
  line.flag("--plain-friction", o.plain_friction,
            "load_meter of a campaign: Coulomb and viscous friction only, nothing added by evidence");
  line.option("--database", o.database, "SQLite file of the machine that keeps the result");
  line.option("--tool", o.tool, "name of the tool, for the database");
  line.option("--material", o.material, "workpiece material, for the database");
  line.option("--rake", o.rake, "[deg] normal rake of the tool, for the database");
  line.option("-o,--output", o.output, "writes the coefficients as a model file's cutting section");
  const ParameterTable table = tableOf(o.parameters);
  ParameterOptions parameters(line, table, "launch/config/loadmeter.yaml, for a bag");
  return runProgram(line, argc, argv, [&] {
    parameters.apply();
    run(o);
  });
}
