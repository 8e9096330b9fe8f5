#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "smartmill_kalman/sensor/transfer_matrix.h"

namespace smartmill::kalman {

/// A dynamometer as a rigid plate with its workpiece on four feet that measure: the wrench of the feet over
/// the wrench applied, both about the origin in the feet's plane, z up. Closed form at every frequency: (K +
/// i w C) (K + i w C - w^2 M)^-1. Defaults: 3 kHz in x and y, 4 kHz in z as the sensor of Bachrathy and
/// Stepan (section 2), its centre of mass above its feet, so that forces turn it.
struct PlateSensor {
  double mass = 2.0;                                          ///< [kg] moving
  std::array<double, 3> centre{{2e-3, -3e-3, 12e-3}};         ///< [m] of mass
  std::array<double, 3> size{{0.105, 0.09, 0.035}};           ///< [m] block of that mass, gives the inertia
  std::array<double, 3> frequency{{3000.0, 3000.0, 4000.0}};  ///< [Hz] if nothing turned
  double foot = 0.036;                                        ///< [m] distance of each foot from the axes
  double damping = 0.02;                                      ///< [1] of critical at those frequencies
  double force_noise = 0.05;                                  ///< [N] rms of a sample
  double moment_noise = 0.0015;                               ///< [N m]

  /// 6x6: forces, then moments, at f [Hz].
  Eigen::MatrixXcd response(double f) const;
  /// What the feet show under a force along time at a fixed point. Exact for band-limited forces; nothing may
  /// happen near the ends. @param force x, y, z [N] @param point [m] @param channels 3 or 6
  std::vector<std::vector<double>> measure(const std::array<std::vector<double>, 3>& force,
                                           const std::array<double, 3>& point, double sample_rate,
                                           std::size_t channels, std::mt19937& random) const;
};

/// Taps of a small hammer (sin^2 hits of 0.11 ms and 300 N, 0.1 N of noise): on the top (down) and on two
/// sides of the workpiece, 14 points as in Bachrathy's fig. 1, each hits times.
std::vector<MatrixTap> tapPlate(const PlateSensor& plate, double sample_rate, std::size_t channels, int hits,
                                std::mt19937& random);

/// A hammer pressed against the plate with a constant force: bounces with a contact spring and damper until
/// it rests (section 2.3). @return contact force [N] over time
std::vector<double> bouncingContact(double sample_rate, double duration, double start);

}  // namespace smartmill::kalman
