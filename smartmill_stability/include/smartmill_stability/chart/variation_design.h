#pragma once

#include <limits>

#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

struct VariationDesignOptions {
  SpeedVariation most{0.2, 0.2};  ///< shape, largest amplitude and largest ratio
  double acceleration = std::numeric_limits<double>::infinity();  ///< [rad/s2] of the spindle, not exceeded
  int amplitudes = 4;                                             ///< evenly spaced up to the largest
  int ratios = 5;                                                 ///< in half octaves down from the largest
};

/// A speed variation for one mean speed.
struct VariationDesign {
  SpeedVariation variation;   ///< amplitude 0: no variation has a larger limit
  double limit = 0.0;         ///< [m] +inf: above the largest depth
  double steady_limit = 0.0;  ///< [m] the same at constant speed
};

/// The variation with the largest limit at a mean speed [rad/s] by collocation, among amplitudes and ratios
/// at which a variation lasts a whole number of tooth passings. @param max_depth [m] @throws Error on values
/// out of range.
VariationDesign designVariation(RegenerativeSystem system, double speed, double max_depth,
                                const VariationDesignOptions& options);

}  // namespace smartmill::stability
