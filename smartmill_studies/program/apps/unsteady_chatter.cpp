// rosrun smartmill_studies program_unsteady_chatter: chatter detection in unsteady cuts. Corners that are too
// short for a steady condition and chatter, and false verdicts in pockets that are stable everywhere.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "program/corner_pocket.h"
#include "program/machined_part.h"
#include "program/pocket_program.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chatter/chatter_detector.h"
#include "study_case.h"

namespace {

using namespace smartmill;

constexpr double HOLD_BACK = 0.05;                // [s]
constexpr std::size_t INTERVAL = 5;               // [blocks of the simulated machine], 0.05 s
constexpr double CHATTERS = 0.02, STABLE = 0.01;  // [1] difference of two runs over the vibration
constexpr int LEAST_INTERVALS = 3;                // of chatter in an unsteady stretch

struct Arguments {
  StudyCase study;
  std::string model = "launch/models/mill_twin.yaml", folder = "unsteady_chatter";
  int cases = 50;
  std::uint64_t seed = 1;
  bool stable = false, runout = false;
};

/// A program that is machined, and the detection next to it.
struct Job {
  MachineModel machine, nominal;
  std::string text, model_file;
  std::uint64_t seed = 0;
  PartSetUp set_up;
};

struct Stretch {
  double from, to;  // [s]
};

struct Outcome {
  std::vector<stability::ChatterState> verdicts;  // in unsteady cuts
  bool steady_chatter = false;
  std::vector<Stretch> unsteady;
  std::vector<float> x, y;  // [m] displacement of the tip
  double time = 0.0;        // [s] of the program

  double unsteadyTime() const {
    double sum = 0.0;
    for (const Stretch& stretch : unsteady) sum += stretch.to - stretch.from;
    return sum;
  }
};

Outcome machined(const Job& job) {
  Outcome outcome;
  std::map<std::string, CuttingCondition::Kind> kinds;
  stability::DetectionPipeline detection(stability::ChatterParameters(), HOLD_BACK,
                                         [&](const stability::ChatterState& state) {
                                           if (!state.valid) return;
                                           if (kinds[state.condition] == CuttingCondition::Kind::unsteady)
                                             outcome.verdicts.push_back(state);
                                           else
                                             outcome.steady_chatter = outcome.steady_chatter || state.chatter;
                                         });
  PartStreams streams;
  bool unsteady = false;
  streams.state = [&](const CncState& state) { detection.push(state); };
  streams.condition = [&](const CuttingCondition& condition) {
    if (unsteady) outcome.unsteady.back().to = condition.stamp;
    unsteady = condition.kind == CuttingCondition::Kind::unsteady;
    if (unsteady) outcome.unsteady.push_back({condition.stamp, condition.stamp});
    kinds[condition.name] = condition.kind;
    detection.push(condition);
  };
  streams.sensors = [&](const sim::World::Block& block) {
    for (const SpindleAngle& angle : block.angle) detection.push(angle);
    detection.push(block.dynamometer);
    for (std::size_t i = 0; i < block.vibration.size(); ++i) {
      outcome.x.push_back(static_cast<float>(block.vibration.at(i, 0)));
      outcome.y.push_back(static_cast<float>(block.vibration.at(i, 1)));
    }
  };
  outcome.time =
      machinePart(job.machine, job.nominal, job.text, preparedPart(job.text, {job.model_file}, job.nominal),
                  job.seed, streams, job.set_up)
          .time;
  detection.flush();
  return outcome;
}

/// [1] In each interval, RMS of the difference of two displacements over that of the first without its mean.
std::vector<double> differences(const Outcome& one, const Outcome& other) {
  constexpr std::size_t LENGTH = INTERVAL * sim::World::BLOCK;
  const std::size_t count = std::min(one.x.size(), other.x.size()) / LENGTH;
  std::vector<double> ratios;
  for (std::size_t k = 0; k < count; ++k) {
    double difference = 0.0, vibration = 0.0;
    for (const auto channel : {&Outcome::x, &Outcome::y}) {
      double mean = 0.0;
      for (std::size_t i = k * LENGTH; i < (k + 1) * LENGTH; ++i) mean += (one.*channel)[i] / LENGTH;
      for (std::size_t i = k * LENGTH; i < (k + 1) * LENGTH; ++i) {
        difference += std::pow((one.*channel)[i] - (other.*channel)[i], 2);
        vibration += std::pow((one.*channel)[i] - mean, 2);
      }
    }
    ratios.push_back(std::sqrt(difference / std::max(vibration, 1e-18)));
  }
  return ratios;
}

/// Values of the intervals from a time to another [s].
std::vector<double> between(const std::vector<double>& values, double from, double to) {
  constexpr double LENGTH = INTERVAL * sim::World::BLOCK / sim::World::SAMPLE_RATE;
  const auto first = std::min(values.size(), static_cast<std::size_t>(std::max(0.0, from / LENGTH)));
  const auto last = std::min(values.size(), static_cast<std::size_t>(to / LENGTH) + 1);
  return {values.begin() + static_cast<std::ptrdiff_t>(first),
          values.begin() + static_cast<std::ptrdiff_t>(last)};
}

/// A corner that chatters and has no second of constant engagement. A vibration that chatters depends on its
/// beginning: a second run whose modes differ by 1e-4 shows where.
nlohmann::json cornerCase(const Arguments& a, int number) {
  constexpr double OTHER = 1.0001;  // [1] natural frequencies of the second run
  const std::uint64_t seed = seedOfCase(a.seed, number);
  std::mt19937_64 random(seed);
  CornerRanges ranges;
  ranges.least_time = 0.1;
  ranges.most_time = 0.6;
  CornerCase drawn = drawCornerCase(readMachineModel(a.model), random, ranges);
  Job job;
  std::filesystem::create_directories(a.folder);
  job.model_file = formatted("%s/machine_%d.yaml", a.folder.c_str(), number);
  writeMachineModel(drawn.machine, job.model_file);
  if (a.runout) drawn.machine.effects = {drawEffect("runout", drawn.machine, random)};
  job.text = cornerProgram(drawn.pocket, drawn.machine);
  job.seed = seed;
  job.machine = job.nominal = drawn.machine;
  job.set_up.from_memory = true;
  job.set_up.magazine = {{1, drawn.machine}};
  const Outcome one = machined(job);
  for (ModalModel* axis : {&job.machine.tool_tip.x, &job.machine.tool_tip.y})
    axis->modes[0].frequency *= OTHER;
  job.set_up.magazine = {{1, job.machine}};
  const std::vector<double> ratios = differences(one, machined(job));

  const double window =
      stability::ChatterParameters().revolutions * units::TWO_PI / drawn.pocket.speed;  // [s]
  int chattering = 0, recognised = 0, wrong = 0;
  for (const Stretch& stretch : one.unsteady) {
    const std::vector<double> within = between(ratios, stretch.from, stretch.to);
    const auto chatters = [](double ratio) { return ratio > CHATTERS; };
    if (std::count_if(within.begin(), within.end(), chatters) < LEAST_INTERVALS) continue;
    ++chattering;
    recognised += std::any_of(one.verdicts.begin(), one.verdicts.end(), [&](const auto& verdict) {
      return verdict.chatter && verdict.stamp > stretch.from && verdict.stamp <= stretch.to;
    });
  }
  for (const stability::ChatterState& verdict : one.verdicts) {
    const std::vector<double> within = between(ratios, verdict.stamp - window, verdict.stamp);
    wrong += verdict.chatter && *std::max_element(within.begin(), within.end()) < STABLE;
  }
  return {{"case", number},
          {"teeth", drawn.machine.tool->teeth},
          {"corner_margin", drawn.pocket.corner_margin},
          {"chattering", chattering},
          {"recognised", recognised},
          {"steady_chatter", one.steady_chatter},
          {"windows", one.verdicts.size()},
          {"false", wrong},
          {"unsteady", one.unsteadyTime()},
          {"time", one.time}};
}

/// A pocket that is stable everywhere, as in program_production, with lines so short that most of the cutting
/// is unsteady; every second tool with 2 to 4 teeth and runout.
nlohmann::json stableCase(const Arguments& a, int number) {
  constexpr double SLOT = 15e-3;  // [m]
  const std::uint64_t seed = seedOfCase(a.seed, number);
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  Job job;
  job.nominal = readMachineModel(a.model);
  if (number % 2 == 1) job.nominal.tool->teeth = 2 + number / 2 % 3;
  std::filesystem::create_directories(a.folder);
  job.model_file = formatted("%s/stable_%d.yaml", a.folder.c_str(), number);
  writeMachineModel(job.nominal, job.model_file);
  job.machine = job.nominal;
  CuttingCoefficients& k = *job.machine.cutting;
  k.ktc = uniform(600.0, 1400.0) * units::N_PER_MM2;
  k.krc = uniform(0.2, 0.5) * k.ktc;
  k.kac = uniform(0.1, 0.3) * k.ktc;
  k.kte = uniform(12.0, 35.0) * units::N_PER_MM;
  k.kre = uniform(0.8, 1.4) * k.kte;
  k.kae = uniform(0.0, 0.2) * k.kte;
  if (number % 2 == 1) job.machine.effects = {drawEffect("runout", job.machine, random)};
  PocketTraits traits = drawStablePocket(random, job.machine);
  traits.slot = SLOT;
  job.text = pocketProgram(traits, job.nominal);
  job.seed = seed;
  const Outcome outcome = machined(job);
  nlohmann::json lines = nlohmann::json::array();
  for (const stability::ChatterState& verdict : outcome.verdicts)
    if (verdict.chatter)
      lines.push_back({{"condition", verdict.condition},
                       {"stamp", verdict.stamp},
                       {"frequency", verdict.frequency},
                       {"energy_ratio", verdict.energy_ratio},
                       {"severity", verdict.severity}});
  return {{"case", number},
          {"teeth", job.nominal.tool->teeth},
          {"runout", number % 2 == 1},
          {"windows", outcome.verdicts.size()},
          {"false", lines.size()},
          {"verdicts", lines},
          {"steady_chatter", outcome.steady_chatter},
          {"unsteady", outcome.unsteadyTime()},
          {"time", outcome.time}};
}

void score(const std::vector<nlohmann::json>& lines) {
  int chattering = 0, recognised = 0, wrong = 0, parts = 0, steady = 0;
  double windows = 0.0, unsteady = 0.0;
  for (const nlohmann::json& line : lines) {
    windows += numberOf(line, "windows");
    unsteady += numberOf(line, "unsteady");
    wrong += line["false"].get<int>();
    steady += line["steady_chatter"].get<bool>();
    if (!line.contains("chattering")) continue;
    parts += line["chattering"].get<int>() > 0;
    chattering += line["chattering"].get<int>();
    recognised += line["recognised"].get<int>();
  }
  if (chattering > 0)
    std::printf("unsteady stretches that chatter: %d in %d pockets, recognised %d\n", chattering, parts,
                recognised);
  std::printf("%zu pockets, %.2f h of unsteady cuts, %.0f windows: %d false verdicts\n", lines.size(),
              unsteady / 3600.0, windows, wrong);
  std::printf("chatter in steady cuts: %d pockets\n", steady);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Chatter detection in unsteady cuts of simulated pockets: corners that chatter and are too short for a "
      "steady condition. With --stable: false verdicts in pockets that are stable everywhere.");
  Arguments a;
  a.study.addTo(line, "--cases", a.cases, "number of machines, each with one pocket");
  a.study.addScore(line);
  line.flag("--stable", a.stable, "stable pockets, every second one with runout");
  line.flag("--runout", a.runout, "tools with runout in the corners that chatter");
  line.option("--model", a.model, "machine model").showDefault();
  line.option("--folder", a.folder, "folder for the models of the machines").showDefault();
  line.option("--seed", a.seed, "of machines, pockets and noise").showDefault();
  return runProgram(line, argc, argv, [&] {
    a.study.run(
        a.cases, [&](int number) { return a.stable ? stableCase(a, number) : cornerCase(a, number); }, score);
  });
}
