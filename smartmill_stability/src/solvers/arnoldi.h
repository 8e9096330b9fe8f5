#pragma once

#include <complex>
#include <functional>

#include <Eigen/Core>

namespace smartmill::stability {

struct Dominant {
  std::complex<double> value;
  Eigen::VectorXcd vector;  ///< empty unless asked for
};

/// Dominant eigenvalue of a linear map of real vectors by Arnoldi's method: as many applications as it needs,
/// at most as many as the size. @param tolerance [1] relative to the eigenvalue's modulus. @param expected
/// in: applications that a similar map needed, 0 unknown; out: those needed here.
Dominant dominantEigenvalue(const std::function<void(const Eigen::VectorXd& in, Eigen::VectorXd& out)>& map,
                            Eigen::Index size, double tolerance, bool with_vector, Eigen::Index& expected);

}  // namespace smartmill::stability
