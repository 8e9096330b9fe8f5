#include "smartmill_stability/chart/pitch_design.h"

#include <algorithm>
#include <limits>

#include "smartmill_core/error.h"

namespace smartmill::stability {
namespace {

using units::TWO_PI;

/// [m] Least limit within the margin.
double leastLimit(RegenerativeSystem system, double variation, double speed, double max_depth,
                  double margin) {
  system.pitch = linearPitch(system.teeth, variation);
  const auto solver = makeFloquetSolver(Method::collocation, system, SolverOptions::ofManyPoints());
  double least = std::numeric_limits<double>::infinity();
  for (const double side : {0.0, margin, -margin})
    least = std::min(least, solver->limit(speed * (1.0 + side), max_depth).depth);
  return least;
}

}  // namespace

std::vector<double> linearPitch(int teeth, double variation) {
  std::vector<double> pitch;
  for (int k = 0; k < teeth; ++k) pitch.push_back(TWO_PI / teeth + (k - 0.5 * (teeth - 1)) * variation);
  return pitch;
}

PitchDesign designPitch(RegenerativeSystem system, double speed, double max_depth,
                        const PitchDesignOptions& options) {
  if (system.cut != Cut::milling || system.teeth < 2)
    throw Error("pitch: expected a milling tool with two or more teeth");
  if (!(speed > 0.0) || !(max_depth > 0.0)) throw Error("pitch: expected speed and depth above 0");
  system.chip.reset();  // linear theory: every tooth cuts along its whole arc
  // The smallest pitch of the largest variation is the least one.
  const double most = 2.0 * (1.0 - options.least_pitch) * TWO_PI / system.teeth / (system.teeth - 1);
  PitchDesign design;
  design.least_limit = -1.0;
  const auto consider = [&](double variation) {
    const double limit = leastLimit(system, variation, speed, max_depth, options.speed_margin);
    if (variation == 0.0) design.even_limit = limit;
    if (limit <= design.least_limit) return;
    design.least_limit = limit;
    design.variation = variation;
  };
  const double step = most / options.steps;
  for (int i = 0; i <= options.steps; ++i) consider(step * i);
  const double best = design.variation;
  for (int i = -options.finer; i <= options.finer; ++i)
    consider(std::clamp(best + step * i / options.finer, 0.0, most));
  design.pitch = linearPitch(system.teeth, design.variation);
  system.pitch = design.pitch;
  design.limit = makeSolver(Method::collocation, system)->limit(speed, max_depth);
  return design;
}

}  // namespace smartmill::stability
