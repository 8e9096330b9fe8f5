#pragma once

#include <vector>

#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Limits at two or more ascending speeds by continuation, fast enough for interactive use: every tenth speed
/// is searched from depth zero by collocation; the speeds between start from a prediction by their neighbours
/// and the zero-order solution, and are interpolated where the prediction is right to 1 %. Where the lobe
/// changes, every speed is solved.
StabilityLimit limitsByContinuation(const RegenerativeSystem& system, const std::vector<double>& speeds,
                                    double max_depth);

}  // namespace smartmill::stability
