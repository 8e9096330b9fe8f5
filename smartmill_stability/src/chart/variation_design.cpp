#include "smartmill_stability/chart/variation_design.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"

namespace smartmill::stability {

VariationDesign designVariation(RegenerativeSystem system, double speed, double max_depth,
                                const VariationDesignOptions& options) {
  options.most.validate();
  if (!(speed > 0.0) || !(max_depth > 0.0)) throw Error("speed variation: expected speed and depth above 0");
  const auto limitOf = [&] {
    return makeSolver(Method::collocation, system, SolverOptions::ofManyPoints())
        ->limit(speed, max_depth)
        .depth;
  };
  VariationDesign design;
  system.variation.reset();
  design.limit = design.steady_limit = limitOf();
  const double passings = system.cut == Cut::milling && system.evenPitch() ? system.teeth : 1;
  double before = 0.0;
  for (int r = 0; r < options.ratios; ++r) {
    const double periods = std::ceil(passings / options.most.ratio * std::pow(2.0, 0.5 * r) * (1.0 - 1e-9));
    if (periods == before) continue;
    before = periods;
    for (int a = 1; a <= options.amplitudes; ++a) {
      SpeedVariation variation = options.most;
      variation.ratio = passings / periods;
      variation.amplitude *= static_cast<double>(a) / options.amplitudes;
      if (variation.acceleration(speed) > options.acceleration) continue;
      system.variation = variation;
      const double limit = limitOf();
      if (limit <= design.limit) continue;
      design.limit = limit;
      design.variation = variation;
    }
  }
  return design;
}

}  // namespace smartmill::stability
