#pragma once

#include <complex>
#include <vector>

#include <Eigen/Core>

#include "solvers/floquet.h"

namespace smartmill::stability {

/// Fourier coefficients of the feedback for a depth of one metre.
struct Harmonics {
  double step = 0.0;  ///< [rad/s] between harmonics
  std::vector<double> delays;
  std::vector<Eigen::Matrix2cd> now, velocity;         ///< [k + most]
  std::vector<std::vector<Eigen::Matrix2cd>> delayed;  ///< [k + most][delay]
  int most = 0;

  Eigen::Matrix2cd at(int k, double w) const;
};

/// @param depth [m] at which the feedback is evaluated, and by which it is divided
Harmonics harmonicsOf(const RegenerativeSystem& system, double speed, int most, double depth = 1.0);

/// Harmonic balance at one speed.
class Balance {
 public:
  /// @param depth [m] at which the feedback is evaluated (with helix it is not proportional to the depth)
  Balance(const RegenerativeSystem& system, const Axes& axes, double speed, int below, int above,
          double depth = 1.0);

  double step() const { return harmonics_.step; }
  Eigen::MatrixXcd matrix(double w) const;
  /// [1/m] Eigenvalues at w [rad/s] with a modulus above `least`.
  std::vector<std::complex<double>> eigenvalues(double w, double least) const;
  /// [Hz] Frequency of the largest component of the eigenvector of an eigenvalue.
  double strongest(double w, std::complex<double> value) const;

 private:
  const RegenerativeSystem& system_;
  const Axes& axes_;
  int below_, above_;
  Harmonics harmonics_;
};

}  // namespace smartmill::stability
