#pragma once

#include <vector>

#include "smartmill_loadmeter/calibration/friction_law.h"
#include "smartmill_loadmeter/calibration/load_meter.h"

namespace smartmill::loadmeter {

struct Estimate {
  double value = 0.0;
  double std_dev = 0.0;
};

/// Idle voltage V = Kb w^2 + KTcf w (Dunwoody eq. 3.6..3.8).
struct IdleVoltage {
  Estimate kb;              ///< [V s2/rad2]
  Estimate ktcf;            ///< [V s/rad]
  double covariance = 0.0;  ///< of the two

  /// [V]
  double at(double speed) const { return LinearFriction{kb.value, ktcf.value}.at(speed) * speed; }
};

/// Unweighted least squares of the voltage, as in the thesis. The standard deviations are the larger of the
/// residuals' and the rounding's (resolution / sqrt(12) each, eq. 3.12).
/// @throws Error with fewer than two speeds at or above zero_below.
IdleVoltage fitIdleVoltage(const std::vector<AirCut>& air_cuts, double zero_below, double resolution);

}  // namespace smartmill::loadmeter
