#pragma once

#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// A cut that differs from the chart's; NaN and 0 leave things as they are.
struct WhatIf {
  static constexpr double SAME = std::numeric_limits<double>::quiet_NaN();

  int teeth = 0;
  double helix = SAME;           ///< [rad]
  double entry = SAME;           ///< [rad]
  double exit = SAME;            ///< [rad]
  double feed_per_tooth = SAME;  ///< [m]
  /// [1] overhang over the measured one. The tool counts as a beam clamped in its holder: compliance with the
  /// cube, frequency with the inverse square (Euler and Bernoulli: k = 3 E I / L^3, w ~ sqrt(E I / A) / L^2).
  double overhang = SAME;
  double axial_depth = SAME;  ///< [m] judged at every speed
  int speeds = 0;             ///< 0: 300
  bool spread = false;        ///< the limits of machines as uncertain as the measured one as well
  /// @throws Error naming the quantity and its value.
  void validate() const;
};

struct WhatIfChart {
  StabilityLimit limit;
  std::vector<int> mode;           ///< that limits the depth at each speed, an index into modes; -1: none
  std::vector<std::string> modes;  ///< e.g. "x 1210 Hz"
  std::vector<double> torque_depth_limit, power_depth_limit;  ///< [m] +inf: no limit known
  /// [m] 10 and 90 % of the drawn machines have their limit below; empty without spread
  std::vector<double> limit_low, limit_high;
  /// [1] of the speeds at which the depth is stable; NaN without a depth
  double stable_share = std::numeric_limits<double>::quiet_NaN();
};

/// The tool as it would vibrate with another overhang. @param overhang [1] as WhatIf::overhang
std::vector<SystemMode> withOverhang(std::vector<SystemMode> modes, double overhang);

/// Limits at rising speeds (two at least), fast enough to follow a slider: by collocation from zero at every
/// tenth speed, between them from what the neighbours and the zero-order solution foretell, and interpolated
/// where that was right to a percent. Where the lobe changes every speed is asked.
StabilityLimit followedLimits(const RegenerativeSystem& system, const std::vector<double>& speeds,
                              double max_depth);

/// The mode that answers most at a frequency [Hz]; -1 for NaN or without modes.
int dominantMode(const std::vector<SystemMode>& modes, double frequency);

}  // namespace smartmill::stability
