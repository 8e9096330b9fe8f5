#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_stability/solvers/solver.h"
#include "smartmill_stability_testing/benchmark.h"

namespace smartmill::stability {

/// Closed form with process damping: one mode along x, four straight teeth in a slot. The squares of the
/// sines of the two engaged teeth sum to 1 and their products with the cosines cancel, so that
///
///     m x'' + (c + C b / v) x' + k x = -Kr b (x(t) - x(t - T)),   T the tooth period.
///
/// At the limit x = exp(i w t): w (c + C b / v) + Kr b sin wT = 0 and k - m w^2 + Kr b (1 - cos wT) = 0.
struct DampedSlot {
  double mass = 0.03993, frequency = 922.0, damping_ratio = 0.011;
  double kr = 2e8;           ///< [N/m2]
  double diameter = 0.02;    ///< [m]
  double coefficient = 0.0;  ///< [N/m] of process damping
  int waves = 4;             ///< tooth periods of a revolution; 1: turning

  double natural() const { return units::TWO_PI * frequency; }  ///< [rad/s]
  double stiffness() const { return mass * natural() * natural(); }

  RegenerativeSystem system() const {
    ModalModel x;
    x.modes = {{frequency, damping_ratio, 1.0 / stiffness()}};
    RegenerativeSystem system;
    system.modes = systemModes(x, 0);
    system.diameter = diameter;
    system.kr = kr;
    if (waves == 1) {
      system.cut = Cut::turning;
      system.entry = 0.5 * units::PI;  // edge and chip normal along x
    } else {
      system.teeth = 4;
      system.kt = 3.0 * kr;  // no effect: its sums cancel
    }
    system.setProcessDamping(coefficient);
    return system;
  }

  /// [m] Limit at a speed [rad/s]: least depth over the roots in w.
  double limit(double speed) const {
    const double period = units::TWO_PI / (waves * speed), v = 0.5 * diameter * speed;
    const double c = 2.0 * damping_ratio * natural() * mass;
    const auto depthAt = [&](double w) { return -w * c / (w * coefficient / v + kr * std::sin(w * period)); };
    const auto residual = [&](double w) {
      return stiffness() - mass * w * w + kr * depthAt(w) * (1.0 - std::cos(w * period));
    };
    double least = std::numeric_limits<double>::infinity();
    // Far finer than a wave: a tooth period contains at most some hundred.
    constexpr int STEPS = 20000, BISECTIONS = 40;
    const auto at = [this](int i) { return natural() * (0.9 + 1.1 * i / STEPS); };
    for (int i = 0; i < STEPS; ++i) {
      double from = at(i), to = at(i + 1);
      // A jump of the depth is a pole, not a root.
      const double ratio = depthAt(to) / depthAt(from);
      if (!(depthAt(from) > 0.0) || !(ratio > 0.5 && ratio < 2.0) || residual(from) * residual(to) > 0.0)
        continue;
      for (int k = 0; k < BISECTIONS; ++k) {
        const double middle = 0.5 * (from + to);
        (residual(middle) * residual(from) > 0.0 ? from : to) = middle;
      }
      least = std::min(least, depthAt(from));
    }
    return least;
  }

  /// [m] Least limit over all phases at a cutting speed v [m/s]: Kr b = 2 k z (1 + z) with the damping ratio
  /// z = damping_ratio + C b / (2 m w_n v), solved for b; +inf: stable at any depth.
  double leastLimit(double v) const {
    const double rise = coefficient / (2.0 * mass * natural() * v), k = stiffness(), z = damping_ratio;
    // 2 k rise^2 b^2 + (2 k rise (1 + 2 z) - Kr) b + 2 k z (1 + z) = 0, the smaller root.
    const double a = 2.0 * k * rise * rise, half = 0.5 * (2.0 * k * rise * (1.0 + 2.0 * z) - kr),
                 constant = 2.0 * k * z * (1.0 + z);
    const double discriminant = half * half - a * constant;
    if (half >= 0.0 || discriminant < 0.0) return std::numeric_limits<double>::infinity();
    return constant / (-half + std::sqrt(discriminant));
  }
};

}  // namespace smartmill::stability
