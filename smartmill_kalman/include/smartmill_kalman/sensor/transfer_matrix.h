#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_kalman/filter/coupled_filter.h"

namespace smartmill::kalman {

/// One tap on the workpiece: point, direction, and records of hammer and sensor.
struct MatrixTap {
  std::array<double, 3> direction{{0, 0, 0}};  ///< [1] of the force; need not be of unit length
  std::array<double, 3> point{{0, 0, 0}};      ///< [m] from the sensor's origin
  std::vector<double> hammer;                  ///< [N]
  std::vector<std::vector<double>> channels;   ///< fx fy fz [N], or also mx my mz [N m]
};

/// Transfer matrices of a force sensor of 3 or 6 channels on the lines of its taps.
struct TransferMatrix {
  std::size_t channels = 0;
  int hits = 0;
  std::vector<double> frequency;             ///< [Hz]
  std::vector<Eigen::MatrixXcd> forward;     ///< measured over applied; units of force and moment
  std::vector<Eigen::MatrixXd> forward_std;  ///< root of E|error|^2
  std::vector<Eigen::MatrixXcd> inverse;     ///< H_F: applied over measured (eq. 2.4)
  std::vector<Eigen::MatrixXd> inverse_std;
  /// [1] of the forward matrix, moments over the lever: amplification of relative errors by the inversion
  std::vector<double> condition;
  double lever = 0.0;  ///< [m] RMS distance of the taps from the sensor's origin, the unit of moments

  /// Units of the condition number: 1 for forces, the lever for moments.
  Eigen::VectorXd scale() const;
  /// Lines with low <= frequency <= high [Hz].
  TransferMatrix band(double low, double high) const;
  /// Element as an FRF with its standard deviations. @param row measured @param column applied
  FrequencyResponse element(std::size_t row, std::size_t column) const;
};

/// Bachrathy and Stepan eq. 2.2..2.7: with force n F and moment r x n F of every tap in E and the measured
/// channels in M, forward = M E^+ and inverse = E M^+ over all hits, line by line. Standard deviations come
/// from the noise in M: its variance per channel and line is the residual variance of the hits (smoothed over
/// neighbouring lines), at least that before the hits. Hammer windowed (Dunwoody eq. 4.17..4.19). The
/// taps do not give the line at 0 Hz (the level before each hit is subtracted): extrapolated from those
/// above.
/// @param sample_rate [Hz] @throws Error when taps differ in length, are fewer than the channels, or do not
/// span all directions (with six channels also moments about all axes).
TransferMatrix identifyTransferMatrix(const std::vector<MatrixTap>& taps, double sample_rate);

}  // namespace smartmill::kalman
