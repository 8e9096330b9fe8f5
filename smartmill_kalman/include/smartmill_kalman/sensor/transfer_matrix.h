#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_kalman/filter/coupled_filter.h"

namespace smartmill::kalman {

/// One tap on the workpiece: where, along what, and what the sensor showed.
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
  /// [1] of the forward matrix: how much inverting it multiplies relative errors; moments over lever
  std::vector<double> condition;
  double lever =
      0.0;  ///< [m] root mean square distance of the taps from the sensor's origin; moments over it

  /// What a condition number counts in: forces as they are, moments over the lever.
  Eigen::VectorXd scale() const;
  /// Lines with low <= frequency <= high [Hz].
  TransferMatrix band(double low, double high) const;
  /// Element as an FRF with its standard deviations. @param row measured @param column applied
  FrequencyResponse element(std::size_t row, std::size_t column) const;
};

/// Bachrathy and Stepan eq. 2.2..2.7: with the force n F and the moment r x n F of every tap in E and what
/// was measured in M, forward = M E^+ and inverse = E M^+ over all hits, line by line. Noise in M is what
/// makes them uncertain: its variance a channel and line from what the hits leave over (smoothed over
/// neighbouring lines), never below what stands before the hits. Hammer windowed (Dunwoody eq. 4.17..4.19).
/// @param sample_rate [Hz] @throws Error when taps differ in length, are fewer than channels, or do not press
/// in every direction (and, of six channels, turn about every axis).
TransferMatrix identifyTransferMatrix(const std::vector<MatrixTap>& taps, double sample_rate);

}  // namespace smartmill::kalman
