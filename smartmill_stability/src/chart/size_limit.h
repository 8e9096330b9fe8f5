#pragma once

#include <vector>

#include "smartmill_stability/chart/risk.h"
#include "smartmill_stability/chart/surface_error.h"
#include "smartmill_stability/chart/uncertainty.h"

namespace smartmill::stability {

/// Whether a finishing cut makes size: the surface location error of its wall, at its speed and at both ends
/// of the speed margin, is within a tolerance.
class SizeLimit {
 public:
  /// @param system of the cut, with modes and a chip geometry of alike teeth @param tolerance [m] > 0 on
  /// either side @param spread margin of the speed, number of drawn machines, seed
  /// @throws Error as WallPrediction
  SizeLimit(const UncertainSystem& system, double tolerance, const RiskOptions& spread);

  /// Of the mean machine. @param speed [rad/s] @param depth [m]
  bool meanHolds(double speed, double depth) const;
  /// With two standard deviations.
  bool holds(double speed, double depth) const;

 private:
  bool within(double speed, double depth, double deviations) const;

  WallPrediction mean_;
  std::vector<WallPrediction> drawn_;
  double tolerance_, margin_;
};

}  // namespace smartmill::stability
