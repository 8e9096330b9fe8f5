#pragma once

#include <complex>
#include <functional>

#include <Eigen/Core>

namespace smartmill::stability {

struct Dominant {
  std::complex<double> value;
  Eigen::VectorXcd vector;  ///< eigenvector; empty unless requested
};

/// Dominant eigenvalue of a linear map of real vectors by Arnoldi's method. By hand, since GenEigsSolver of
/// Spectra refuses maps of fewer than three values and fixes the number of applications before its first test
/// of convergence, which here follows from the last similar map.
/// @param tolerance [1] relative to the modulus of the eigenvalue. @param with_vector computes the
/// eigenvector too.
/// @param expected in: number of applications for a similar map, 0: unknown; out: the number for this map.
Dominant dominantEigenvalue(const std::function<void(const Eigen::VectorXd& in, Eigen::VectorXd& out)>& map,
                            Eigen::Index size, double tolerance, bool with_vector, Eigen::Index& expected);

}  // namespace smartmill::stability
