#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// Tabulated effective chip: piecewise linear from zero, extrapolated beyond the last node.
struct EffectiveChipCurve {
  std::vector<double> chip;       ///< [m] > 0, rising; two or more
  std::vector<double> effective;  ///< [m] of each, rising

  double at(double h) const {
    std::size_t k = 0;
    while (k + 1 < chip.size() && h > chip[k]) ++k;
    const double h0 = k ? chip[k - 1] : 0.0, e0 = k ? effective[k - 1] : 0.0;
    return e0 + (h - h0) * (effective[k] - e0) / (chip[k] - h0);
  }
};

/// Force of a chip, per metre of edge and in the frame of the edge:
///
///     Ft = chip_factor ktc h' + edge_factor kte e + 0.3 d      Fr = chip_factor krc h' + edge_factor kre e +
///     d Fa = chip_factor kac h' + edge_factor kae e
///
/// with h' = course(h) (h / size_reference)^-size_exponent, e = 1 - exp(-h / edge_chip) and d = damping v_r /
/// v_c, the velocity into the work over the cutting speed. Where h <= 0 there is no force at all (formats.md,
/// effects.md).
struct CuttingLaw {
  CuttingCoefficients coefficients;
  double chip_factor = 1.0;                        ///< [1] on ktc, krc, kac
  double edge_factor = 1.0;                        ///< [1] on kte, kre, kae
  double edge_chip = 0.0;                          ///< [m] over which the edge terms build up; 0: at once
  double size_exponent = 0.0;                      ///< [1]
  double size_reference = 1e-4;                    ///< [m]
  const EffectiveChipCurve* chip_curve = nullptr;  ///< not owned; nullptr: h itself
  double damping = 0.0;                            ///< [N/m]
  double damping_radial =
      1.0;  ///< [1] share of d across the tool; below 1 where the edge is inclined (corner.h)
  double damping_axial = 0.0;  ///< [1] share of d along the tool
};

/// [1] Ratio of tangential to radial force of process damping.
inline constexpr double TANGENTIAL_DAMPING = 0.3;

/// [m] h' of a chip h > 0.
inline double effectiveChip(const CuttingLaw& law, double chip) {
  const double h = law.chip_curve ? law.chip_curve->at(chip) : chip;
  return law.size_exponent == 0.0 ? h : h * std::pow(chip / law.size_reference, -law.size_exponent);
}

/// [1] e of a chip h > 0.
inline double edgeShare(const CuttingLaw& law, double chip) {
  return law.edge_chip > 0.0 ? -std::expm1(-chip / law.edge_chip) : 1.0;
}

/// Force in the frame of the machine: x, y, axial and tangential [N/m of edge].
struct EdgeForce {
  double fx = 0.0, fy = 0.0, fz = 0.0, ft = 0.0;

  void add(double weight, double tangential, double radial, double axial, double sine, double cosine) {
    fx += weight * (-tangential * cosine - radial * sine);
    fy += weight * (tangential * sine - radial * cosine);
    fz += weight * axial;
    ft += weight * tangential;
  }
};

}  // namespace smartmill
