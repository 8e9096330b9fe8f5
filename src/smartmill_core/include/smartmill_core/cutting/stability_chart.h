#pragma once

#include <limits>
#include <string>
#include <vector>

namespace smartmill {

/// Stability limit over spindle speed.
struct StabilityLimit {
  std::vector<double> spindle_speed;      ///< [rad/s] rising
  std::vector<double> depth;              ///< [m] +inf: no limit found
  std::vector<double> chatter_frequency;  ///< [Hz] at the limit; NaN without a limit
};

/// One cut of a chart.
struct StabilityPoint {
  double spindle_speed = 0.0;                                           ///< [rad/s]
  double axial_depth = 0.0;                                             ///< [m]
  double depth_limit = 0.0;                                             ///< [m] +inf: none
  double chatter_frequency = std::numeric_limits<double>::quiet_NaN();  ///< [Hz] at the limit
  double torque = 0.0;                 ///< [N m] mean cutting torque at the chart's feed per tooth
  double power = 0.0;                  ///< [W] mean cutting power
  double material_removal_rate = 0.0;  ///< [m3/s]
};

/// Stable cuts of a machine (topic stability/chart).
struct StabilityChart {
  double stamp = 0.0;  ///< [s] of the newest input
  std::string tool, material;
  std::string method;              ///< zero_order or collocation
  double entry = 0.0, exit = 0.0;  ///< [rad] immersion angles
  double feed_per_tooth = 0.0;     ///< [m] for torque and power
  StabilityLimit limit;
  std::vector<double> torque_depth_limit;  ///< [m] +inf: no limit known; the friction torque is deducted
  std::vector<double> power_depth_limit;   ///< [m]
  /// [m] stable at any speed (collocation: of the chart)
  double absolute_depth_limit = std::numeric_limits<double>::quiet_NaN();
  std::vector<StabilityPoint> recommended;  ///< highest removal rate first, one per pocket
  std::vector<StabilityPoint> unstable;  ///< between the pockets, nearest to the best recommended speed first
};

}  // namespace smartmill
