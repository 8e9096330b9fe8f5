// rosrun smartmill_studies program_production: coefficients of machines with unknown ones from the program of
// one pocket each, through the simulated Fanuc control and the bridge, without a test cut: Ktc and Kte by the
// load meter, Krc and Kre by the compensated force of the dynamometer.

#include <algorithm>
#include <array>
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
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"
#include "study_case.h"

namespace {

using namespace smartmill;

constexpr double HOLD_BACK = 0.05;  // [s]
constexpr std::array<const char*, 4> NAMES{"ktc", "krc", "kte", "kre"};

struct Arguments {
  StudyCase study;
  std::string model = "launch/models/mill_twin.yaml";
  bool instrument_errors = false;
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
  std::optional<loadmeter::CoefficientRecord> last;  // of the cuts with a measured force
  int forces = 0;                                    // number of these
};

/// Errors of the dynamometer as the parameters of the load meter's node state them: one gain for all
/// channels, and a zero that has drifted since the last air cut.
class InstrumentErrors {
 public:
  InstrumentErrors(const loadmeter::ForceEstimateParameters& stated, std::uint64_t seed)
      : stated_(stated), random_(seed) {
    gain_ += stated.sensor_error * normal_(random_);
  }
  void begin(const CuttingCondition& condition) {
    for (double& zero : zero_)
      zero = condition.kind == CuttingCondition::Kind::cut ? stated_.sensor_zero * normal_(random_) : 0.0;
  }
  SampleBlock applied(SampleBlock block) const {
    const std::size_t channels = block.channels.size();
    for (std::size_t k = 0; k < block.samples.size(); ++k)
      if (k % channels < zero_.size()) block.samples[k] = gain_ * block.samples[k] + zero_[k % channels];
    return block;
  }

 private:
  loadmeter::ForceEstimateParameters stated_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  double gain_ = 1.0;                      // [1]
  std::array<double, 3> zero_{{0, 0, 0}};  // [N]
};

/// Machines a pocket; the load meter identifies the coefficients.
Part identifiedPart(const Arguments& a, const MachineModel& machine, const MachineModel& nominal,
                    const std::string& text, std::uint64_t seed) {
  const loadmeter::IdentificationParameters parameters;
  loadmeter::IdentificationPipeline pipeline(nominal, parameters, HOLD_BACK);
  std::optional<InstrumentErrors> errors;
  if (a.instrument_errors) errors.emplace(parameters.force, seed + 1);
  Part part;
  pipeline.identification().outputs().cut = [&](const loadmeter::CoefficientRecord& record) {
    if (!std::isfinite(record.set.value.krc)) return;
    part.last = record;
    ++part.forces;
  };
  kalman::CompensationOutputs outputs;
  outputs.force.compensated = [&](const ForceBlock& block) { pipeline.push(block); };
  kalman::CompensationPipeline compensation(kalman::CompensationParameters(), kalman::TapParameters(),
                                            nominal.force_sensor, HOLD_BACK, outputs);
  PartStreams streams;
  streams.state = [&](const CncState& state) {
    pipeline.push(state);
    compensation.push(state);
  };
  streams.load = [&](const LoadSample& load) { pipeline.push(load); };
  streams.condition = [&](const CuttingCondition& condition) {
    pipeline.push(condition);
    compensation.push(condition);
    if (errors) errors->begin(condition);
  };
  streams.sensors = [&](const sim::World::Block& block) {
    for (const SpindleAngle& angle : block.angle) compensation.push(angle);
    compensation.push(errors ? errors->applied(block.dynamometer) : block.dynamometer);
  };
  static_cast<MachinedPart&>(part) =
      machinePart(machine, nominal, text, preparedPart(text, {a.model}, nominal), seed, streams);
  compensation.flush();
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
  const Part part = identifiedPart(a, machine, nominal, text, seed);
  nlohmann::json line{
      {"case", number}, {"cuts", part.cuts}, {"air", part.air}, {"lost", part.lost}, {"time", part.time}};
  for (const char* name : NAMES) line[name] = line[std::string("z_") + name] = nullptr;
  if (!part.estimate) return line;
  const double ktc = part.estimate->ktc() - machine.cutting->ktc,
               kte = part.estimate->kte() - machine.cutting->kte;
  line["ktc"] = ktc / machine.cutting->ktc;
  line["kte"] = kte / machine.cutting->kte;
  line["z_ktc"] = ktc / part.estimate->ktcStd();
  line["z_kte"] = kte / part.estimate->kteStd();
  if (!part.last) return line;
  // The deviations of a record are those of one of the cuts in the estimate.
  const double share = 1.0 / std::sqrt(static_cast<double>(part.forces));
  const auto add = [&](const char* name, double CuttingCoefficients::*coefficient) {
    const double truth = machine.cutting.value().*coefficient;
    const double error = part.last->set.value.*coefficient - truth;
    line[name] = error / truth;
    line[std::string("z_") + name] = error / (share * (part.last->set.std_dev.*coefficient));
  };
  add("krc", &CuttingCoefficients::krc);
  add("kre", &CuttingCoefficients::kre);
  return line;
}

void score(const std::vector<nlohmann::json>& lines) {
  std::printf("%zu machines, one pocket each; aims: Ktc and Krc 1 %%, Kte 5 %%\n", lines.size());
  std::printf("%-6s %8s %8s %8s  %s\n", "[%]", "median", "95 %", "worst", "inside 1.96 std");
  for (const char* name : NAMES) {
    std::vector<double> errors;
    double inside = 0.0;
    for (const nlohmann::json& line : lines) {
      const double error = numberOf(line, name);
      if (!std::isfinite(error)) continue;
      errors.push_back(100.0 * std::abs(error));
      inside += std::abs(numberOf(line, (std::string("z_") + name).c_str())) < 1.96;
    }
    if (errors.empty()) {
      std::printf("%-6s no estimate\n", name);
      continue;
    }
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
  line.flag("--instrument-errors", a.instrument_errors,
            "gain and zero of the dynamometer have errors of the size that the shipped parameters state");
  line.option("--seed", a.seed, "of machines, pockets and noise").showDefault();
  return runProgram(line, argc, argv, [&] {
    a.study.run(
        a.cases, [&](int number) { return lineOf(a, number); }, score);
  });
}
