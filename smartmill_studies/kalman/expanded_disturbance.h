#pragma once

#include <complex>
#include <vector>

#include <Eigen/Core>

#include "kalman/tuning.h"
#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// Burzoni's expanded disturbance model (eq. 4-43..4-50): the force is a constant and an undamped oscillator
/// at the tooth passing frequency, both driven by one noise w (theta_dc = theta_ac = 1), in addition to the
/// modes of the sensor; discretised exactly (5-9), stationary gain (5-46), force after the measurement update
/// (5-47).
class ExpandedDisturbanceFilter {
 public:
  /// @param tooth_passing [Hz] @param q [N2/s] intensity of w @param r [N2] of a sample. @throws Error.
  ExpandedDisturbanceFilter(const ModalModel& sensor, double sample_rate, double tooth_passing, double q,
                            double r);
  /// @param measured [N] @return applied force [N] at this sample.
  double step(double measured);
  /// FRF from measured to estimated force at f [Hz].
  std::complex<double> response(double f) const;

 private:
  double sample_rate_;
  Eigen::MatrixXd phi_;
  Eigen::RowVectorXd shown_, force_;
  Eigen::VectorXd gain_, state_;
};

/// Force of a record.
std::vector<double> expandedDisturbanceForce(const std::vector<double>& measured, const ModalModel& sensor,
                                             double sample_rate, double tooth_passing, double q, double r);

/// tapMap() with this filter, which depends on the spindle speed.
TuningMap expandedTapMap(const ReferenceTaps& taps, const ModalModel& sensor, double sample_rate, double r,
                         const std::vector<double>& speeds, int flutes, double band);

/// Exponent n of the least RMSE of a cut over q = 2^n (eq. 6-2), and that RMSE [N].
struct CutOptimum {
  int exponent = 0;
  double rmse = 0.0;
  std::vector<double> all;  ///< [N] of every exponent
};
CutOptimum bestOfCut(const std::vector<double>& measured, const std::vector<double>& truth,
                     const ModalModel& sensor, double sample_rate, double spindle_speed, int flutes, double r,
                     double band);

/// Kurtosis E(x - mean)^4 / sigma^4 (eq. 5-17); 3 of a Gaussian.
double kurtosis(const std::vector<double>& values);

}  // namespace smartmill::kalman
