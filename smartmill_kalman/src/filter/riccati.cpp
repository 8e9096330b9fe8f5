#include "smartmill_kalman/filter/riccati.h"

#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::kalman {

Eigen::MatrixXd stationaryCovariance(const Eigen::MatrixXd& phi, const Eigen::MatrixXd& q,
                                     const Eigen::RowVectorXd& c, double r) {
  constexpr int MAX_DOUBLINGS = 60;
  constexpr double TOLERANCE = 1e-12;
  const Eigen::Index n = phi.rows();
  Eigen::MatrixXd a = phi.transpose();
  Eigen::MatrixXd g = c.transpose() * c / r;
  Eigen::MatrixXd h = q;
  for (int i = 0; i < MAX_DOUBLINGS; ++i) {
    Eigen::MatrixXd both(n, 2 * n);
    both << a, g;
    both = linear::solve(Eigen::MatrixXd(Eigen::MatrixXd::Identity(n, n) + g * h), both);
    const auto w_a = both.leftCols(n), w_g = both.rightCols(n);
    const Eigen::MatrixXd rise = a.transpose() * h * w_a;
    const Eigen::MatrixXd more = a * w_g * a.transpose();
    h += 0.5 * (rise + rise.transpose());
    g += 0.5 * (more + more.transpose());
    a = (a * w_a).eval();
    if (!h.allFinite()) break;
    if (rise.norm() <= TOLERANCE * h.norm()) return h;
  }
  throw Error("Kalman filter: the Riccati equation of " + std::to_string(n) +
              " states has no stationary solution");
}

StationaryGain stationaryGain(const Eigen::MatrixXd& phi, const Eigen::MatrixXd& q,
                              const Eigen::RowVectorXd& c, double r) {
  StationaryGain found;
  found.covariance = stationaryCovariance(phi, q, c, r);
  found.variance = (c * found.covariance * c.transpose())(0) + r;
  found.gain = found.covariance * c.transpose() / found.variance;
  return found;
}

}  // namespace smartmill::kalman
