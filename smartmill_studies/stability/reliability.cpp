#include "stability/reliability.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/error.h"
#include "stability/twin_agreement.h"

namespace smartmill::stability {
namespace {

constexpr int SAMPLES = 180, REVOLUTIONS = 180;

}  // namespace

MachineModel machineOf(const MachineModel& model, const RegenerativeSystem& drawn) {
  MachineModel machine = model;
  std::size_t k = 0;
  for (ModalModel* axis : {&machine.tool_tip.x, &machine.tool_tip.y}) {
    for (Mode& mode : axis->modes) {
      const SystemMode& m = drawn.modes.at(k++);
      const double w = units::TWO_PI * m.frequency;
      mode.frequency = m.frequency;
      mode.damping_ratio = m.damping_ratio;
      mode.gain = (m.input[0] * m.output[0] + m.input[1] * m.output[1]) / (w * w);
    }
  }
  machine.cutting->ktc = drawn.kt;
  machine.cutting->krc = drawn.kr;
  return machine;
}

std::array<double, 2> wilson(int k, int n) {
  if (n == 0) return {{0.0, 1.0}};
  constexpr double Z = 1.959964;
  const double p = static_cast<double>(k) / n, z2 = Z * Z / n;
  const double middle = (p + 0.5 * z2) / (1.0 + z2);
  const double half = Z * std::sqrt(p * (1.0 - p) / n + 0.25 * z2 / n) / (1.0 + z2);
  return {{std::max(0.0, middle - half), std::min(1.0, middle + half)}};
}

std::vector<ReliabilityPoint> reliabilityStudy(const MachineModel& model, const RegenerativeSystem& system,
                                               const ReliabilityOptions& options,
                                               const std::function<void(double)>& progress) {
  if (options.machines < 1) throw Error("machines: expected at least 1");
  if (options.draws < 1) throw Error("draws: expected at least 1");
  options.validate();
  const UncertainSystem belief = UncertainSystem::of(model, system);
  const auto nominal = makeSolver(Method::collocation, system);
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> unit;
  std::vector<ReliabilityPoint> points;
  std::vector<MachineModel> machines;
  std::vector<TwinCut> cuts;
  for (int tries = 0; static_cast<int>(points.size()) < options.machines; ++tries) {
    if (tries > 50 * options.machines + 100) throw Error("reliability: no speed with a limit found");
    ReliabilityPoint p;
    p.speed = options.speed_low + (options.speed_high - options.speed_low) * unit(random);
    const double limit = nominal->limit(p.speed, options.max_depth).depth;
    const double share = 0.7 + 0.6 * unit(random);
    if (!std::isfinite(limit)) continue;
    p.depth = share * limit;
    const RegenerativeSystem truth = belief.draw(random);
    p.chatters = makeFloquetSolver(Method::collocation, truth)->multiplier(p.speed, p.depth).radius() > 1.0;
    p.predicted = chatterProbability(belief, p.speed, p.depth, options.draws,
                                     options.seed + 1000u + static_cast<unsigned>(points.size()));
    points.push_back(p);
    if (!options.by_twin) continue;
    machines.push_back(machineOf(model, truth));
    cuts.push_back({p.speed,
                    {system.entry, system.exit, p.depth, 0.1e-3},
                    wholeTeeth(SAMPLES, system.teeth),
                    REVOLUTIONS,
                    0});
    if (progress) progress(0.5 * static_cast<double>(points.size()) / options.machines);
  }
  if (options.by_twin) {
    const int samples = cuts.front().samples, period = system.evenPitch() ? samples / system.teeth : samples;
    runTwinCuts(
        machines, cuts, {{"tool_x", "tool_y"}},
        [&](std::size_t i, const Record& record) {
          points[i].observed_chatter =
              repeatsNoMore(record, samples, period, cuts[i].engagement.feed_per_tooth);
        },
        [&](double share) {
          if (progress) progress(0.5 + 0.5 * share);
        });
  }
  return points;
}

std::vector<ReliabilityBin> reliabilityBins(const std::vector<ReliabilityPoint>& points, int bins,
                                            bool by_twin) {
  std::vector<ReliabilityBin> found(static_cast<std::size_t>(bins));
  for (const ReliabilityPoint& p : points) {
    ReliabilityBin& bin =
        found[static_cast<std::size_t>(std::min(bins - 1, static_cast<int>(p.predicted * bins)))];
    ++bin.count;
    bin.predicted += p.predicted;
    bin.observed += by_twin ? p.observed_chatter : p.chatters;
  }
  for (ReliabilityBin& bin : found) {
    if (bin.count == 0) continue;
    const auto interval = wilson(static_cast<int>(std::lround(bin.observed)), bin.count);
    bin.low = interval[0];
    bin.high = interval[1];
    bin.predicted /= bin.count;
    bin.observed /= bin.count;
  }
  return found;
}

double reliabilityScore(const std::vector<ReliabilityPoint>& points, bool by_twin) {
  double difference = 0.0, variance = 0.0;
  for (const ReliabilityPoint& p : points) {
    difference += (by_twin ? p.observed_chatter : p.chatters) - p.predicted;
    variance += p.predicted * (1.0 - p.predicted);
  }
  return variance > 0.0 ? difference / std::sqrt(variance) : 0.0;
}

}  // namespace smartmill::stability
