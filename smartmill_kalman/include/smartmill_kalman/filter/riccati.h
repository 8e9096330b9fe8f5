#pragma once

#include <Eigen/Core>

namespace smartmill::kalman {

/// Stationary covariance P of the one-step prediction error of a Kalman filter:
/// P = phi (P - P c' (c P c' + r)^-1 c P) phi' + q, by the structure-preserving doubling algorithm (quadratic
/// convergence; every iterate stays symmetric and positive semidefinite).
/// @param phi n x n transition, q n x n process noise covariance of a step, c 1 x n output, r > 0 measurement
/// noise variance
/// @throws Error when it does not converge (a state that is neither observable nor damped).
Eigen::MatrixXd stationaryCovariance(const Eigen::MatrixXd& phi, const Eigen::MatrixXd& q,
                                     const Eigen::RowVectorXd& c, double r);

/// Stationary Kalman filter of one output.
struct StationaryGain {
  Eigen::MatrixXd covariance;  ///< P, by stationaryCovariance()
  double variance = 0.0;       ///< c P c' + r, of the innovation
  Eigen::VectorXd gain;        ///< P c' / variance
};
/// Parameters and errors as stationaryCovariance().
StationaryGain stationaryGain(const Eigen::MatrixXd& phi, const Eigen::MatrixXd& q,
                              const Eigen::RowVectorXd& c, double r);

}  // namespace smartmill::kalman
