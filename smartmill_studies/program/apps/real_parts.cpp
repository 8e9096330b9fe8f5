// rosrun smartmill_studies program_real_parts: programs with several tools, as a CAM post writes them, from
// the text to stored coefficients of each tool.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "program/machined_part.h"
#include "program/real_programs.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"
#include "smartmill_program/live/condition_names.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/program_analysis.h"

namespace {

using namespace smartmill;

constexpr double HOLD_BACK = 0.05;  // [s]
constexpr double COLUMN = 1e-4;     // [m] of the stock

struct Arguments {
  std::string model = "launch/models/mill_twin.yaml", folder = "real_parts";
  std::string part;
  bool cuts = false;
  int machines = 1;
  std::uint64_t seed = 1;
};

/// The machine's model with a tool, and coefficients of its own.
MachineModel withTool(const MachineModel& machine, const ToolGeometry& tool, std::mt19937_64& random) {
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  MachineModel model = machine;
  model.tool = tool;
  CuttingCoefficients& k = *model.cutting;
  k.ktc = uniform(600.0, 1400.0) * units::N_PER_MM2;
  k.krc = uniform(0.2, 0.5) * k.ktc;
  k.kte = uniform(12.0, 35.0) * units::N_PER_MM;
  k.kre = uniform(0.8, 1.4) * k.kte;
  return model;
}

/// True models of the tools, and files for the nodes, without coefficients and modes.
struct Tools {
  std::map<int, MachineModel> truth;
  std::vector<std::string> true_files, files;  // N=FILE
};

Tools toolsOf(const RealPart& part, const MachineModel& machine, const std::string& folder,
              std::mt19937_64& random) {
  Tools tools;
  for (const auto& [number, geometry] : part.tools) {
    MachineModel model = withTool(machine, geometry, random);
    tools.truth[number] = model;
    const std::string file = folder + "/" + part.name + "_T" + std::to_string(number);
    writeMachineModel(model, file + "_true.yaml");
    model.cutting.reset();
    model.tool_tip = {};
    writeMachineModel(model, file + ".yaml");
    const std::string key = std::to_string(number) + "=" + file;
    tools.true_files.push_back(key + "_true.yaml");
    tools.files.push_back(key + ".yaml");
  }
  return tools;
}

void analyse(const RealPart& part, const Tools& tools, const Workpiece& workpiece) {
  const auto begin = std::chrono::steady_clock::now();
  program::ToolModels models(tools.true_files);
  const std::vector<program::Move> moves = program::interpretProgram(part.text, part.name);
  program::Stock stock(program::StockBlock{workpiece.low, workpiece.high}, COLUMN);
  program::AnalysisOptions options;
  options.simulation.rapid = models.rapid();
  program::ProgramAnalysis analysis(part.name, models, stock, options);
  const program::AnalysisResult result = analysis.run(moves);
  const double time = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  double force = 0.0, margin = 1e9;
  int hits = 0, unstable = 0;
  for (const program::BlockSummary& block : result.blocks) {
    if (block.peak_force > force) force = block.peak_force;
    if (block.margin < margin) margin = block.margin;
    unstable += block.margin < 1.0;
    hits += block.rapid_hit;
  }
  std::printf(
      "%-16s %zu lines, %zu moves, %.0f s, %.1f cm3; analysed in %.1f s (%.0f times as fast as it runs); "
      "largest force %.0f N, least margin %.2f, %d blocks below 1, %d rapid hits\n",
      part.name.c_str(), static_cast<std::size_t>(std::count(part.text.begin(), part.text.end(), '\n')),
      moves.size(), result.time, result.volume * 1e6, time, result.time / time, force, margin, unstable,
      hits);
}

void machine(const RealPart& part, const Tools& tools, const MachineModel& truth,
             const std::string& database_file, std::uint64_t seed, bool with_cuts) {
  MachineModel nominal = truth;
  nominal.cutting.reset();
  loadmeter::CoefficientDatabase database(database_file);
  loadmeter::IdentificationPipeline pipeline(nominal, loadmeter::IdentificationParameters(), HOLD_BACK);
  std::map<std::string, int> stored;
  pipeline.identification().outputs().cut = [&](const loadmeter::CoefficientRecord& record) {
    stored[record.set.tool] += database.add(record);
  };
  // Torque of each cut over that of its engagement with the true coefficients.
  pipeline.identification().outputs().test = [&](const loadmeter::LoadTest& test) {
    if (!with_cuts || !test.isCut()) return;
    const Spindle& spindle = *truth.spindle;
    const double torque = test.voltage.mean / (spindle.load_meter_gain * test.speed) -
                          spindle.viscous * test.speed - spindle.coulomb;
    const CuttingCondition& c = test.condition;
    const CuttingCoefficients& k = *tools.truth.at(program::toolNumberOf(c.tool_name)).cutting;
    std::printf("  %-28s %s %5.1f to %5.1f deg, %.3f mm deep, %.4f mm per tooth: torque %.4f N m, %+.2f %%\n",
                c.name.c_str(), c.tool_name.c_str(), units::degFromRad(c.engagement.entry),
                units::degFromRad(c.engagement.exit), c.engagement.axial_depth / units::MM,
                c.engagement.feed_per_tooth / units::MM, torque,
                100.0 * (torque / MechanisticForce(c.tool, k, c.engagement).mean().torque - 1.0));
  };
  int turning = 0;
  PartStreams streams;
  streams.state = [&](const CncState& state) { pipeline.push(state); };
  streams.load = [&](const LoadSample& load) { pipeline.push(load); };
  streams.condition = [&](const CuttingCondition& condition) {
    turning += feedTurns(condition);
    pipeline.push(condition);
  };
  PartSetUp set_up;
  set_up.from_memory = true;
  set_up.magazine = tools.truth;
  const MachinedPart done = machinePart(truth, nominal, part.text,
                                        preparedPart(part.text, tools.files, nominal), seed, streams, set_up);
  pipeline.flush();
  std::printf("%-16s %zu cuts (%d along arcs), %zu in air, %zu losses of the path, %.0f s\n",
              part.name.c_str(), done.cuts, turning, done.air, done.lost, done.time);
  for (const auto& [number, model] : tools.truth) {
    const std::string name = program::toolName("end_mill", number, tools.truth.size() > 1);
    const auto set = database.find(name, nominal.workpiece->material);
    if (!set) {
      std::printf("  %-12s nothing stored\n", name.c_str());
      continue;
    }
    loadmeter::CoefficientQuery query;
    query.tool = name;
    query.material = nominal.workpiece->material;
    const auto estimate = database.estimate(query);
    const CuttingCoefficients &k = *model.cutting, &v = set->value;
    std::printf(
        "  %-12s %d records, Ktc %.1f N/mm2 (true %.1f, %+.2f %%, %.2f %% std), Kte %.2f N/mm (true %.2f, "
        "%+.2f %%, %.2f %% std)\n",
        name.c_str(), stored[name], v.ktc / units::N_PER_MM2, k.ktc / units::N_PER_MM2,
        100.0 * (v.ktc / k.ktc - 1.0), 100.0 * estimate->set.std_dev.ktc / k.ktc, v.kte / units::N_PER_MM,
        k.kte / units::N_PER_MM, 100.0 * (v.kte / k.kte - 1.0), 100.0 * estimate->set.std_dev.kte / k.kte);
  }
}

void run(const Arguments& a) {
  std::filesystem::create_directories(a.folder);
  const MachineModel truth = readMachineModel(a.model);
  for (const Control control : {Control::fanuc, Control::linuxcnc}) {
    for (const RealPart& part : realParts(*truth.workpiece, control)) {
      std::ofstream file(a.folder + "/" + part.name + (control == Control::fanuc ? ".nc" : ".ngc"));
      if (!(file << part.text).flush()) throw Error(a.folder + ": cannot be written");
    }
  }
  for (int number = 0; number < a.machines; ++number) {
    for (const RealPart& part : realParts(*truth.workpiece, Control::fanuc)) {
      if (!a.part.empty() && part.name != a.part) continue;
      const std::uint64_t seed = a.seed + static_cast<std::uint64_t>(number);
      std::mt19937_64 random(seed);
      const Tools tools = toolsOf(part, truth, a.folder, random);
      analyse(part, tools, *truth.workpiece);
      const std::string database = formatted("%s/%s_%d.sqlite", a.folder.c_str(), part.name.c_str(), number);
      std::filesystem::remove(database);
      machine(part, tools, truth, database, seed, a.cuts);
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Three programs with several tools as a CAM post writes them: analysis, then on the simulated machine "
      "from "
      "the control's memory to the coefficients of each tool in a database.");
  Arguments a;
  line.option("--model", a.model, "machine model with modes and workpiece").showDefault();
  line.option("--machines", a.machines, "number of machines, each with its own coefficients").showDefault();
  line.option("--part", a.part, "only this one: adaptive_pocket, thin_rib or scallop_surface");
  line.flag("--cuts", a.cuts, "also prints each cut with its torque");
  line.option("--seed", a.seed, "of coefficients and noise").showDefault();
  line.option("--folder", a.folder, "folder for models and databases").showDefault();
  return runProgram(line, argc, argv, [&] { run(a); });
}
