// rosrun smartmill_studies program_production: coefficients of machines with unknown ones from the program of
// one pocket each, through the simulated Fanuc control and the bridge, without a test cut.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "program/machined_part.h"
#include "program/pocket_program.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"
#include "study_case.h"

namespace {

using namespace smartmill;

constexpr double HOLD_BACK = 0.05;  // [s]

struct Arguments {
  StudyCase study;
  std::string model = "launch/models/mill_twin.yaml";
  int cases = 20;
  std::uint64_t seed = 1;
};

double uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Coefficients of aluminium to soft steel, and a spindle whose friction its model does not state.
MachineModel drawMachine(const MachineModel& base, std::mt19937_64& random) {
  MachineModel machine = base;
  CuttingCoefficients& k = *machine.cutting;
  k.ktc = uniform(random, 600.0, 1400.0) * units::N_PER_MM2;
  k.krc = uniform(random, 0.2, 0.5) * k.ktc;
  k.kac = uniform(random, 0.1, 0.3) * k.ktc;
  k.kte = uniform(random, 12.0, 35.0) * units::N_PER_MM;
  k.kre = uniform(random, 0.8, 1.4) * k.kte;
  k.kae = uniform(random, 0.0, 0.2) * k.kte;
  machine.spindle->viscous *= uniform(random, 0.5, 2.0);
  machine.spindle->coulomb *= uniform(random, 0.5, 2.0);
  return machine;
}

struct Part : MachinedPart {
  std::optional<loadmeter::RecursiveCoefficients> estimate;
};

/// Machines a pocket; the load meter identifies the coefficients.
Part identifiedPart(const MachineModel& machine, const MachineModel& nominal, const std::string& text,
                    const std::string& model_file, std::uint64_t seed) {
  loadmeter::IdentificationPipeline pipeline(nominal, loadmeter::IdentificationParameters(), HOLD_BACK);
  PartStreams streams;
  streams.state = [&](const CncState& state) { pipeline.push(state); };
  streams.load = [&](const LoadSample& load) { pipeline.push(load); };
  streams.condition = [&](const CuttingCondition& condition) { pipeline.push(condition); };
  Part part;
  static_cast<MachinedPart&>(part) =
      machinePart(machine, nominal, text, preparedPart(text, model_file, nominal), seed, streams);
  pipeline.flush();
  part.estimate = pipeline.identification().production();
  return part;
}

nlohmann::json lineOf(const Arguments& a, int number) {
  const std::uint64_t seed = seedOfCase(a.seed, number);
  std::mt19937_64 random(seed);
  MachineModel nominal = readMachineModel(a.model);
  const MachineModel machine = drawMachine(nominal, random);
  nominal.cutting.reset();
  const PocketTraits traits = drawStablePocket(random, machine);
  const std::string text = pocketProgram(traits, nominal);
  const Part part = identifiedPart(machine, nominal, text, a.model, seed);
  nlohmann::json line{
      {"case", number}, {"cuts", part.cuts}, {"air", part.air}, {"lost", part.lost}, {"time", part.time}};
  line["ktc"] = line["kte"] = line["z_ktc"] = line["z_kte"] = nullptr;
  if (!part.estimate) return line;
  const double ktc = part.estimate->ktc() - machine.cutting->ktc,
               kte = part.estimate->kte() - machine.cutting->kte;
  line["ktc"] = ktc / machine.cutting->ktc;
  line["kte"] = kte / machine.cutting->kte;
  line["z_ktc"] = ktc / part.estimate->ktcStd();
  line["z_kte"] = kte / part.estimate->kteStd();
  return line;
}

void score(const std::vector<nlohmann::json>& lines) {
  std::printf("%zu machines, one pocket each; 1 %% and 5 %% are the aims\n", lines.size());
  std::printf("%-6s %8s %8s %8s  %s\n", "[%]", "median", "95 %", "worst", "inside 1.96 std");
  for (const char* name : {"ktc", "kte"}) {
    std::vector<double> errors;
    double inside = 0.0;
    for (const nlohmann::json& line : lines) {
      const double error = numberOf(line, name);
      if (!std::isfinite(error)) continue;
      errors.push_back(100.0 * std::abs(error));
      inside += std::abs(numberOf(line, (std::string("z_") + name).c_str())) < 1.96;
    }
    if (errors.empty()) throw Error("no machine has an estimate");
    std::printf("%-6s %8.2f %8.2f %8.2f  %.0f of %zu\n", name, median(errors), percentile(errors, 0.95),
                *std::max_element(errors.begin(), errors.end()), inside, errors.size());
  }
  std::map<std::string, double> mean;
  for (const nlohmann::json& line : lines)
    for (const char* name : {"cuts", "air", "lost", "time"})
      mean[name] += numberOf(line, name) / static_cast<double>(lines.size());
  std::printf("on average %.1f cuts, %.1f stretches in air, %.2f losses of the path, %.0f s\n", mean["cuts"],
              mean["air"], mean["lost"], mean["time"]);
}

void run(const Arguments& a) {
  if (a.study.scores()) return score(readJsonLines(a.study.lines));
  a.study.run(
      a.cases, [&](int number) { return lineOf(a, number); }, score);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Cutting coefficients of random machines from one pocket each: simulated Fanuc control, bridge, "
      "follower "
      "of the program and load meter in one process.");
  Arguments a;
  a.study.addTo(line, "--cases", a.cases, "number of machines");
  a.study.addScore(line);
  line.option("--model", a.model, "machine model with tool, coefficients and workpiece").showDefault();
  line.option("--seed", a.seed, "of machines, pockets and noise").showDefault();
  return runProgram(line, argc, argv, [&] { run(a); });
}
