#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_stability/chart/bistable.h"
#include "smartmill_stability/chart/chart.h"

namespace smartmill::stability {

/// Limits of small and large vibrations of the measured machine by a force curve (topic stability/bistable).
struct BistableChart {
  double stamp = 0.0;  ///< [s] of the newest input
  std::string tool, material;
  double entry = 0.0, exit = 0.0;  ///< [rad]
  double feed = 0.0;               ///< [m] per tooth: the chart's, at most the curve's thickest chip
  double mean_chip = 0.0;          ///< [m]
  double slope = 0.0;              ///< [N/m2] tangential, there
  std::vector<BistableLimit> limits;
};

/// By collocation from the modes in x and y; takes seconds. Empty while those or coefficients are missing,
/// and where the curve is another tool's. @param speeds [1] evenly over the chart's. @throws Error as
/// bistableLimits().
std::optional<BistableChart> bistableChart(const ChartMaker& maker, const ChartParameters& parameters,
                                           const IdentifiedForceCurves& curves, int speeds);

}  // namespace smartmill::stability
