#pragma once

#include <vector>

#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Solver of the limits of a chart.
struct ChartSolver {
  Method method = Method::zero_order;  ///< or collocation
  RegenerativeSystem system;           ///< collocation: with modes; zero_order: with receptances
  double max_depth = 0.0;              ///< [m] of the search by collocation

  /// @param speeds [rad/s] ascending
  StabilityLimit limits(const std::vector<double>& speeds) const;
  /// [m] Depth below which every speed is stable. zero_order without process damping: any speed; else the
  /// speeds of the limits of a chart.
  double absoluteDepthLimit(const StabilityLimit& chart) const;
};

}  // namespace smartmill::stability
