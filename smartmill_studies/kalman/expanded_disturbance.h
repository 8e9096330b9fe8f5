#pragma once

#include <complex>
#include <vector>

#include <Eigen/Core>

#include "kalman/tuning.h"
#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// Burzoni's expanded disturbance (eq. 4-43..4-50): the force is f_a = f_c + f_ha, a constant with f_c' =
/// w_dc and a harmonic f_ha = cos(w_t t) * w_ac, the output of s / (s^2 + w_t^2) with states x1' = -w_t^2 x2
/// + w_ac, x2' = x1, f_ha = x1 and w_t the tooth passing frequency; it enters the modes, x_n' = A_n x_n + B_n
/// (f_c + C_f x_f). One noise w drives both, w_dc = theta_dc w and w_ac = theta_ac w; he states neither
/// theta, here both are 1. No harmonic of w_t is modelled. Discretised exactly (5-9), stationary gain (5-46),
/// force after the measurement update (5-47).
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
