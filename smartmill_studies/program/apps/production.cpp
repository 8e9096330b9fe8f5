// rosrun smartmill_studies program_production: coefficients of machines with unknown ones from the program of
// one pocket each, through the simulated Fanuc control and the bridge, without a test cut.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "program/pocket_program.h"
#include "smartmill_cnc/bridge.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_focas/server.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"
#include "smartmill_program/live/path_follower.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/prediction/stability_limits.h"
#include "smartmill_sim/world/world.h"
#include "study_case.h"

namespace {

using namespace smartmill;

constexpr double PERIOD = 0.02;                     // [s] of the controller's states
constexpr double LATE = 0.005;                      // [s] largest delay of a stamp
constexpr double MOST_TIME = 600.0;                 // [s] of a part
constexpr double STABLE = 0.7;                      // [1] depth over the stability limit of a slot
constexpr double HOLD_BACK = 0.05;                  // [s]
constexpr std::chrono::microseconds TRANSFER(200);  // for the server's thread

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

std::shared_ptr<const program::LiveProgram> prepared(const std::string& text, const std::string& model_file,
                                                     const MachineModel& model) {
  program::ToolModels tools({model_file});
  program::Stock stock({model.workpiece->low, model.workpiece->high}, 1e-4);
  return std::make_shared<const program::LiveProgram>(
      program::prepareProgram("pocket.nc", program::interpretProgram(text, "pocket.nc"), tools, stock,
                              program::SimulationOptions(), program::StretchParameters()));
}

cnc::MotionParameters motionOf(const MachineModel& model) {
  cnc::MotionParameters motion;
  motion.read_only = false;
  motion.limits.travel = model.axes->travel;
  motion.limits.max_feed = model.axes->rapid;
  motion.limits.max_spindle_speed = *model.spindle->max_speed;
  return motion;
}

struct Part {
  std::optional<loadmeter::RecursiveCoefficients> estimate;
  std::size_t cuts = 0, air = 0, lost = 0;
  double time = 0.0;  // [s] of the program
};

/// Runs a program from its first block to its end. @throws Error when the controller refuses it
Part machinePart(const MachineModel& machine, const MachineModel& nominal, const std::string& text,
                 const std::shared_ptr<const program::LiveProgram>& program, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  sim::WorldOptions options;
  options.seed = seed;
  sim::World world(machine, options);
  focas::ServerOptions server_options;
  server_options.port = 0;
  focas::Server server(server_options, world.controller().calls());
  cnc::FocasParameters focas;
  focas.port = server.port();
  focas.reply_timeout = 20.0;
  cnc::Bridge bridge(cnc::makeFocasController(focas), 1.0, motionOf(nominal));
  program::PathFollower follower(program, {{0, 0, 0}}, {"end_mill", nominal.workpiece->material},
                                 program::FollowerParameters());
  loadmeter::IdentificationPipeline pipeline(nominal, loadmeter::IdentificationParameters(), HOLD_BACK);

  Part part;
  sim::World::Block block;
  double now = 0.0;
  bool started = false;
  while (now < MOST_TIME) {
    for (int i = 0; i < 2; ++i) world.advance(block);
    now += PERIOD;
    bridge.fetch(now);
    bridge.step(now + uniform(random, 0.0, LATE));
    std::this_thread::sleep_for(TRANSFER);
    const CncState& state = bridge.state();
    if (state.connected) {
      pipeline.push(state);
      if (bridge.load()) pipeline.push(*bridge.load());
      if (const auto condition = follower.handle(state)) {
        part.cuts += condition->kind == CuttingCondition::Kind::cut;
        part.air += condition->kind == CuttingCondition::Kind::air;
        pipeline.push(*condition);
      }
    }
    if (!started && state.connected && !state.armed) {
      const auto answer = bridge.arm(true);
      if (answer.code != cnc::ArmCode::ok) throw Error("arm: " + answer.message);
    } else if (!started && state.armed) {
      if (const auto refusal = bridge.runProgram("pocket", text, CuttingCondition()))
        throw Error("program: " + refusal->message);
      started = true;
      part.time = -now;
    }
    if (const auto outcome = bridge.takeOutcome()) {
      if (outcome->code != cnc::MotionCode::ok) throw Error("program: " + outcome->message);
      part.time += now;
      break;
    }
  }
  if (now >= MOST_TIME) throw Error("program: it has not ended");
  pipeline.flush();
  part.estimate = pipeline.identification().production();
  part.lost = follower.status().lost;
  return part;
}

nlohmann::json lineOf(const Arguments& a, int number) {
  const std::uint64_t seed = seedOfCase(a.seed, number);
  std::mt19937_64 random(seed);
  MachineModel nominal = readMachineModel(a.model);
  const MachineModel machine = drawMachine(nominal, random);
  nominal.cutting.reset();
  PocketTraits traits = drawPocket(random);
  // The shop's depth does not chatter.
  const program::Contact slot{{{0.0, units::PI, traits.depth}}};
  traits.depth = std::min(traits.depth,
                          STABLE * program::StabilityLimits(machine).limit(slot, 0.0, false, traits.speed));
  const std::string text = pocketProgram(traits, nominal);
  const Part part = machinePart(machine, nominal, text, prepared(text, a.model, nominal), seed);
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
  a.study.check(a.cases);
  if (a.study.one()) return a.study.print(lineOf(a, a.study.number));
  std::vector<nlohmann::json> lines;
  for (int i = 0; i < a.cases; ++i) {
    lines.push_back(lineOf(a, i));
    a.study.print(lines.back());
    std::fflush(stdout);
  }
  score(lines);
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
