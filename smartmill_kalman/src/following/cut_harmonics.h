#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_kalman/following/mode_follower.h"

namespace smartmill::kalman {

constexpr std::size_t REVOLUTION_POINTS = 1024;  ///< samples of the force; harmonics up to a quarter of them
constexpr std::size_t TERMS = 4;                 ///< of the force: tangential and radial, chip and edge
using Sensor = std::array<ModalModel, 2>;        ///< x, y
using Basis = std::array<ModeFollower::Harmonics, TERMS>;

/// Harmonics of the force for each coefficient alone: tangential and radial, chip and edge.
Basis harmonicsOf(const ToolGeometry& tool, const Engagement& engagement, const std::vector<double>& radius);

/// Solution of a linear least-squares problem, its normal matrix stiffened by a share of its diagonal.
Eigen::VectorXd leastSquares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& target, double stiffer);

/// Weighted harmonics of one revolution of the cut: a real and an imaginary row for each axis and harmonic,
/// including the mean.
class WeightedHarmonics {
 public:
  WeightedHarmonics(const ModeFollower::Harmonics& measured, std::size_t count, double noise_std,
                    double misfit, const Sensor& now, double spindle_speed);

  Eigen::Index rows() const { return static_cast<Eigen::Index>(4 * count_); }
  const Eigen::VectorXd& target() const { return target_; }

  /// Weighted sensor output of a force. @param harmonic (axis, n) to [N]
  template <class Harmonic>
  Eigen::VectorXd outputOf(const Sensor& sensor, const Harmonic& harmonic) const {
    Eigen::VectorXd column(rows());
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t n = 0; n < count_; ++n) {
        const std::complex<double> y = sensor[axis].response(frequency(n)) * harmonic(axis, n);
        const Eigen::Index row = rowOf(axis, n);
        column(row) = weight_(row) * y.real();
        column(row + 1) = weight_(row) * y.imag();
      }
    }
    return column;
  }
  Eigen::MatrixXd outputOf(const Sensor& sensor, const Basis& basis) const;

  /// Weighted sensor output by an additional mode in an axis, at constant static gain.
  Eigen::VectorXd hidden(std::size_t axis, const Mode& mode, const Sensor& sensor, const Basis& basis) const;
  double highest() const { return static_cast<double>(count_ - 1) * spindle_frequency_; }  ///< [Hz]

  /// Residual with the force model's numbers at their best for this sensor.
  Eigen::VectorXd innovations(const Sensor& sensor, const Basis& basis) const;

 private:
  double frequency(std::size_t n) const { return static_cast<double>(n) * spindle_frequency_; }
  Eigen::Index rowOf(std::size_t axis, std::size_t n) const {
    return static_cast<Eigen::Index>(2 * (axis * count_ + n));
  }

  std::size_t count_;
  double spindle_frequency_;  // [Hz]
  Eigen::VectorXd weight_, target_;
};

/// Initial radii [m] of the teeth: to first order, runout changes the chip thickness of each tooth.
std::vector<double> firstRadii(const WeightedHarmonics& measured, const Sensor& now, const ToolGeometry& tool,
                               const Engagement& engagement);

}  // namespace smartmill::kalman
