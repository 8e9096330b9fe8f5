#pragma once

#include <vector>

#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

struct PitchDesignOptions {
  double speed_margin = 0.02;  ///< [1] the limit is the least at the speed and at both ends of this margin
  double least_pitch = 0.6;    ///< [1] of the even pitch: the chips need space
  int steps = 60;              ///< of the variation
  int finer = 6;               ///< of a step on either side of the best
};

/// Pitch angles of linear variation, P, P + dP, P + 2 dP, ..., sum 2 pi.
std::vector<double> linearPitch(int teeth, double variation);

/// A tool for one speed.
struct PitchDesign {
  double variation = 0.0;     ///< [rad] from one pitch to the next
  std::vector<double> pitch;  ///< [rad]
  Limit limit;                ///< at the speed
  double least_limit = 0.0;   ///< [m] within the margin; +inf: above the largest depth
  double even_limit = 0.0;    ///< [m] the same with even pitch
};

/// The linear pitch variation with the largest limit at a speed [rad/s] by collocation. Budak's closed form
/// (J. Manuf. Sci. Eng. 125, 2003) makes the phases of the surfaces that the teeth meet cancel at the chatter
/// frequency w: dP = pi speed / w for an even number of teeth, (N +- 1) / N of it for an odd one.
/// @param system milling with two or more teeth; its pitch is replaced @param max_depth [m]
/// @throws Error on values out of range.
PitchDesign designPitch(RegenerativeSystem system, double speed, double max_depth,
                        const PitchDesignOptions& options = {});

}  // namespace smartmill::stability
