#pragma once

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/cutting/speed_variation.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Feedback of the tool motion u to the force at one time: F = now u(t) + velocity u'(t) + sum_k delayed_k
/// u(t - delay_k). Axes: x, y.
struct Feedback {
  Eigen::Matrix2d now = Eigen::Matrix2d::Zero();       ///< [N/m]
  Eigen::Matrix2d velocity = Eigen::Matrix2d::Zero();  ///< [N s/m]
  std::vector<Eigen::Matrix2d> delayed;                ///< [N/m] one for each delay

  void clear(std::size_t delays) {
    now.setZero();
    velocity.setZero();
    delayed.assign(delays, Eigen::Matrix2d::Zero());
  }
};

/// Linear system of modes with periodic delayed feedback, which is smooth between the breaks.
struct DelayedSystem {
  std::vector<SystemMode> modes;
  double period = 0.0;         ///< [s] of the feedback
  std::vector<double> delays;  ///< [s] 0 < delay <= period; lower bounds of delays that vary
  /// [s] Delay k at t, where it varies; empty: `delays`. Supported by collocation.
  std::function<double(std::size_t k, double t)> delay;
  std::vector<double> breaks;  ///< [s] in [0, period), in any order
  /// [N/m] Upper bound of the stiffness of the feedback; sets the resolution.
  double stiffness = 0.0;
  double rate = 0.0;  ///< [rad/s] fastest variation of the feedback
  /// Feedback at t as the smooth continuation from the time `inside`, which lies between the same breaks.
  std::function<void(double t, double inside, Feedback& feedback)> feedback;
};

/// The regenerative system at a speed [rad/s] and depth [m]. Principal period: the tooth period for even
/// pitch, else a revolution.
DelayedSystem delayedSystem(const RegenerativeSystem& system, double speed, double depth);

/// The same with the contact of the teeth in the forced vibration (system.chip). Principal period: a
/// revolution.
DelayedSystem contactSystem(const RegenerativeSystem& system, double speed, double depth);

/// A system of constant speed [rad/s] with the speed varied about it. Principal period: the least number of
/// variations that lasts a whole number of periods of the system; the variation begins at the time 0.
/// @throws Error on a ratio without such a period.
DelayedSystem withSpeedVariation(const DelayedSystem& mean, const SpeedVariation& variation, double speed);

/// Dominant multiplier of a delayed system by Chebyshev collocation. @param nodes of an element, 4..40
CharacteristicMultiplier collocationMultiplier(const DelayedSystem& system, int nodes);

/// The same by semi-discretization. @param steps in a period @param order of the delayed term, 0..2
CharacteristicMultiplier semiDiscretizationMultiplier(const DelayedSystem& system, int steps, int order);

}  // namespace smartmill::stability
