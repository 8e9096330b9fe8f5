#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/tool.h"

namespace smartmill::testing {

/// The chip rule of formats.md summed over thin discs, independent of the code under test except for the
/// input structs.
struct DiscMill {
  struct State {
    double angle;                        ///< [rad] of tooth 1
    std::array<double, 2> centre;        ///< [m] position by the feed
    std::array<double, 2> displacement;  ///< [m]
    std::array<double, 2> rate{{0, 0}};  ///< [m/s] of the displacement, for process damping
    double speed = 1.0;                  ///< [rad/s]
  };
  ToolGeometry tool;
  CuttingLaw law;
  std::vector<double> radius;                 ///< [m] of each tooth over the nominal one
  std::function<State(double turned)> state;  ///< over the rotation of the spindle, negative included
  int passes = 40;
  bool by_path = false;  ///< true path of the teeth instead of the rule: the surface on the ray

  double pitch(int k) const {
    return tool.pitch.empty() ? 2.0 * M_PI / tool.teeth
                              : tool.pitch[static_cast<std::size_t>(k % tool.teeth)];
  }

  /// [m] Chip of a tooth at an immersion angle after a rotation of the spindle.
  double chip(double turned, int tooth, double phi) const {
    return by_path ? chipByPath(turned, tooth, phi) : chipByRule(turned, tooth, phi);
  }

  double chipByPath(double turned, int tooth, double phi) const {
    const State now = state(turned);
    const double s = std::sin(phi), c = std::cos(phi), own = radius[static_cast<std::size_t>(tooth)];
    double least = 1e300, back = 0.0;
    for (int n = 1; n <= passes; ++n) {
      back += pitch(tooth + n - 1);
      const double reach = 0.5 * tool.diameter + radius[static_cast<std::size_t>((tooth + n) % tool.teeth)];
      double beside = 0.0, along = 0.0;  // [rad], [m]
      for (int step = 0; step < 6; ++step) {
        const State then = state(turned - back + beside);
        const double x = then.centre[0] + then.displacement[0] - now.centre[0] - now.displacement[0] +
                         reach * std::sin(phi + beside);
        const double y = then.centre[1] + then.displacement[1] - now.centre[1] - now.displacement[1] +
                         reach * std::cos(phi + beside);
        along = x * s + y * c;
        beside -= (x * c - y * s) / reach;
      }
      least = std::min(least, 0.5 * tool.diameter + own - along);
    }
    return least;
  }

  double chipByRule(double turned, int tooth, double phi) const {
    const State now = state(turned);
    const double s = std::sin(phi), c = std::cos(phi);
    double least = 1e300, back = 0.0, first = 0.0;
    for (int n = 1; n <= passes; ++n) {
      back += pitch(tooth + n - 1);
      const State then = state(turned - back);
      const double dx = now.centre[0] - then.centre[0], dy = now.centre[1] - then.centre[1];
      const double along = dx * s + dy * c, across = dx * c - dy * s;
      if (n == 1) first = across;
      const double vibration =
          (now.displacement[0] - then.displacement[0]) * s + (now.displacement[1] - then.displacement[1]) * c;
      const double offset = radius[static_cast<std::size_t>(tooth)] -
                            radius[static_cast<std::size_t>((tooth + n) % tool.teeth)];
      least = std::min(least, along + (across * across - first * first) / tool.diameter + offset + vibration);
    }
    return least;
  }

  CuttingForce force(double turned, double entry, double exit, double depth, int discs) const {
    const State now = state(turned);
    const double lag = std::tan(tool.helix) / (0.5 * tool.diameter), dz = depth / discs;
    CuttingForce sum;
    double position = 0.0;
    for (int j = 0; j < tool.teeth; ++j) {
      for (int i = 0; i < discs; ++i) {
        double phi = std::fmod(now.angle + position - lag * (i + 0.5) * dz, 2.0 * M_PI);
        if (phi < 0.0) phi += 2.0 * M_PI;
        if (phi < entry || phi >= exit) continue;
        const double h = chip(turned, j, phi);
        if (h <= 0.0) continue;
        const double s = std::sin(phi), c = std::cos(phi);
        const CuttingCoefficients& k = law.coefficients;
        const double kc = law.chip_factor * std::pow(h / law.size_reference, -law.size_exponent);
        const double e = law.edge_factor * (law.edge_chip > 0.0 ? 1.0 - std::exp(-h / law.edge_chip) : 1.0);
        const double damping =
            law.damping * (now.rate[0] * s + now.rate[1] * c) / (now.speed * 0.5 * tool.diameter);
        const double ft = (kc * k.ktc * h + e * k.kte + 0.3 * damping) * dz;
        const double fr = (kc * k.krc * h + e * k.kre + damping) * dz;
        sum.fx += -ft * c - fr * s;
        sum.fy += ft * s - fr * c;
        sum.fz += (kc * k.kac * h + e * k.kae) * dz;
        sum.torque += ft * 0.5 * tool.diameter;
      }
      position += pitch(j);
    }
    return sum;
  }
};

}  // namespace smartmill::testing
