#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "smartmill_loadmeter/motor/force_estimate.h"

namespace smartmill::loadmeter {

/// Rotation from the frame of the feed (x along the feed, z along spindle or edge) to the machine's. @param
/// heading [rad] as CutMeasurements::heading
Eigen::Matrix3d feedFrame(const ToolGeometry& tool, double heading);

/// Forces as functions of the coefficients: linear in the mean, quadratic in the variance over a tooth
/// period.
class CutMechanics {
 public:
  /// Quantities: mean force X, Y, Z, torque, RMS of X, Y, Z, then the squared amplitudes of the tooth passing
  /// harmonics of each axis.
  static constexpr int TORQUE = 3, RMS = 4, LINES = 7, QUANTITIES = LINES + 3 * TOOTH_HARMONICS;
  static constexpr Eigen::Index COEFFICIENTS = 6;
  static int lineOf(int axis, int tooth) { return LINES + axis * TOOTH_HARMONICS + tooth - 1; }

  CutMechanics(const CutMeasurements& r, const ForceEstimateParameters& p);

  /// [N], [N m], [N2] @param at Ktc and Kte in units of the prior, the others as ratios to them
  Eigen::VectorXd of(const Eigen::VectorXd& at) const;

 private:
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Unit = Eigen::Matrix<double, 3, 6>;  // force per coefficient
  void addSquares(const std::vector<Unit>& all, const Unit& mean, int axis);

  double ktc_, kte_;  // [N/m2], [N/m] units of `at`
  Eigen::Matrix<double, 4, 6> mean_;
  std::array<Matrix6, QUANTITIES - RMS> squares_;  // quadratic forms of the variations
};

}  // namespace smartmill::loadmeter
