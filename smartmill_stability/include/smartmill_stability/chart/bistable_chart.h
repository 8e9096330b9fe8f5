#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_stability/chart/bistable.h"
#include "smartmill_stability/chart/chart.h"

namespace smartmill::stability {

/// Limits of small and large vibrations of the measured machine for a force curve (topic stability/bistable).
struct BistableChart {
  double stamp = 0.0;  ///< [s] of the newest input
  std::string tool, material;
  double entry = 0.0, exit = 0.0;  ///< [rad]
  double feed = 0.0;               ///< [m] per tooth, limited to the largest chip thickness of the curve
  double mean_chip = 0.0;          ///< [m]
  double slope = 0.0;              ///< [N/m2] of the tangential force at mean_chip
  std::vector<BistableLimit> limits;
};

/// By collocation from the modes in x and y; takes seconds. Empty while modes or coefficients are missing,
/// and when the curve belongs to a tool with another number of teeth.
/// @param speeds [1] number of speeds, evenly spaced over the range of the chart. @throws Error as
/// bistableLimits().
std::optional<BistableChart> bistableChart(const ChartMaker& maker, const ChartParameters& parameters,
                                           const IdentifiedForceCurves& curves, int speeds);

}  // namespace smartmill::stability
