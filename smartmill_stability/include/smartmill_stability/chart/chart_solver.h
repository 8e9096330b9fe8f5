#pragma once

#include <memory>
#include <vector>

#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/solvers/solver.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {

/// Solver of the limits of a chart.
struct ChartSolver {
  RegenerativeProcess process;
  ToolTipResponse response;                 ///< zero-order
  std::unique_ptr<StabilitySolver> solver;  ///< collocation
  double max_depth = 0.0;                   ///< [m] of the search by collocation

  StabilityLimit limits(const std::vector<double>& speeds) const;
};

}  // namespace smartmill::stability
