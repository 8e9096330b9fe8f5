#include "stability/boundary_agreement.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"
#include "stability/twin_agreement.h"
#include "stability/twin_cuts.h"

namespace smartmill::stability {
namespace {

// Resolution of a cut.
constexpr double SAMPLES_OF_A_WAVE = 40.0;
constexpr int LEAST_SAMPLES = 180;  // per revolution

/// [1] Revolutions after which cut and speed repeat; 0: one tooth passing.
int revolutionsOf(const std::optional<SpeedVariation>& variation) {
  if (!variation) return 0;
  constexpr int MOST = 20;
  for (int n = 1; n <= MOST; ++n) {
    const double revolutions = n / variation->ratio;
    if (std::abs(std::remainder(revolutions, 1.0)) < 1e-9 * revolutions)
      return static_cast<int>(std::lround(revolutions));
  }
  throw Error("agreement: expected a variation that lasts a whole number of revolutions");
}

}  // namespace

std::vector<SidedLimit> agreementAtBoundary(const MachineModel& model, const BoundaryOptions& options,
                                            const std::function<void(double)>& progress) {
  options.validate();
  if (options.points < 1 || options.revolutions < 100 || !(options.side > 0.0 && options.side < 0.5))
    throw Error("agreement: expected points, 100 revolutions or more and a side of 0..50 %");
  const int cycle = revolutionsOf(options.variation);
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> unit;
  const bool several = model.workpiece_modes.size() > 1;
  std::vector<SidedLimit> points;
  std::vector<MachineModel> models;
  std::vector<TwinCut> cuts;
  for (int tries = 0; static_cast<int>(points.size()) < options.points; ++tries) {
    if (tries > 10 * options.points + 100) throw Error("agreement: no limits found up to the largest depth");
    SidedLimit p;
    p.speed = options.speed_low + (options.speed_high - options.speed_low) * unit(random);
    MachineModel there = model;
    if (several) {
      const double low = model.workpiece_modes.front().position, high = model.workpiece_modes.back().position;
      p.position = low + (high - low) * unit(random);
      there = atPosition(model, p.position);
    }
    RegenerativeSystem system = systemOf(there, options.entry_deg, options.exit_deg);
    system.variation = options.variation;
    p.limit = makeSolver(Method::collocation, system)->limit(p.speed, options.max_depth);
    if (!std::isfinite(p.limit.depth)) continue;
    double highest = 0.0;
    for (const SystemMode& mode : system.modes) highest = std::max(highest, mode.frequency);
    const int samples = wholeTeeth(
        std::max(LEAST_SAMPLES,
                 static_cast<int>(std::ceil(SAMPLES_OF_A_WAVE * highest * units::TWO_PI / p.speed))),
        system.teeth);
    // Both halves of a record hold whole cycles.
    const int halves = cycle > 0 ? 2 * cycle : 2;
    const int revolutions = (options.revolutions + halves - 1) / halves * halves;
    for (const double side : {-options.side, options.side}) {
      TwinCut cut{p.speed, {system.entry, system.exit, (1.0 + side) * p.limit.depth, options.feed},
                  samples, revolutions,
                  0,       options.variation};
      cuts.push_back(cut);
      models.push_back(there);
    }
    points.push_back(p);
  }
  const int teeth = model.needTool("simulate cuts").teeth;
  runTwinCuts(
      models, cuts, {{"tool_x", "tool_y"}},
      [&](std::size_t i, const Record& record) {
        const int period = cycle > 0 ? cycle * cuts[i].samples : cuts[i].samples / teeth;
        const bool chatters = repeatsNoMore(record, cuts[i].samples, period, options.feed);
        (i % 2 == 0 ? points[i / 2].below_chatters : points[i / 2].above_chatters) = chatters;
      },
      progress);
  return points;
}

}  // namespace smartmill::stability
