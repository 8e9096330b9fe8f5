#pragma once

#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/chart/measured_machine.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Changes to the cut of a chart; NaN and 0 keep the chart's value.
struct WhatIf {
  static constexpr double SAME = std::numeric_limits<double>::quiet_NaN();

  int teeth = 0;
  double helix = SAME;           ///< [rad]
  double entry = SAME;           ///< [rad]
  double exit = SAME;            ///< [rad]
  double feed_per_tooth = SAME;  ///< [m]
  /// [1] Overhang over the measured one. The tool is modelled as a cantilever beam: compliance ~ L^3,
  /// frequency ~ 1 / L^2 (Euler-Bernoulli: k = 3 E I / L^3, w ~ sqrt(E I / A) / L^2).
  double overhang = SAME;
  double axial_depth = SAME;  ///< [m] compared with the limit at every speed
  int speeds = 0;             ///< 0: 300
  bool spread = false;        ///< also computes the spread of the limits from the uncertainty of the machine
  /// @throws Error naming the quantity and its value.
  void validate() const;
};

struct WhatIfChart {
  StabilityLimit limit;
  std::vector<int> mode;           ///< index into modes of the limiting mode at each speed; -1: none
  std::vector<std::string> modes;  ///< for example "x 1210 Hz"
  std::vector<double> torque_depth_limit, power_depth_limit;  ///< [m] +inf: unknown
  /// [m] 10 % and 90 % quantiles of the limits of the drawn machines; empty without spread
  std::vector<double> limit_low, limit_high;
  /// [1] Fraction of the speeds at which the depth is stable; NaN without a depth
  double stable_share = std::numeric_limits<double>::quiet_NaN();
};

/// Modes of the tool at another overhang. @param overhang [1] as WhatIf::overhang
std::vector<SystemMode> withOverhang(std::vector<SystemMode> modes, double overhang);

/// Index of the mode with the largest receptance at a frequency [Hz]; -1 for NaN or without modes.
int dominantMode(const std::vector<SystemMode>& modes, double frequency);

/// The chart of a modified cut, by collocation from the modes, fast enough for interactive use.
/// @throws Error while modes of x and y or the tangential coefficient are missing, and on an invalid request.
WhatIfChart whatIfChart(const ChartCut& cut, const MeasuredMachine& machine, const WhatIf& request);

}  // namespace smartmill::stability
