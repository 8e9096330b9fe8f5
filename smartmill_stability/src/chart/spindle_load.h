#pragma once

#include <array>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/chart/chart_parameters.h"

namespace smartmill::stability {

/// Torque and power of the spindle in the cut of a chart.
class SpindleLoad {
 public:
  SpindleLoad(const ChartCut& cut, const CoefficientSet& coefficients)
      : cut_(cut), coefficients_(coefficients) {}

  /// [m] Depths at which the rated torque and the rated power are reached at a speed [rad/s]; +inf: unknown.
  std::array<double, 2> limits(double speed) const;
  /// A cut with its torque, power and removal rate.
  StabilityPoint point(double speed, double depth, double limit, double frequency) const;

 private:
  double torquePerDepth() const;  // [N]
  double friction(double speed) const;

  const ChartCut& cut_;
  const CoefficientSet& coefficients_;
};

}  // namespace smartmill::stability
