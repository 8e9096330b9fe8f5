#pragma once

#include <array>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// Force on the tool and torque of the spindle.
struct CuttingForce {
  double fx = 0.0, fy = 0.0, fz = 0.0;  ///< [N] x feed direction
  double torque = 0.0;                  ///< [N m] sum of tangential forces x R

  void add(const CuttingForce& other, double weight = 1.0) {
    fx += weight * other.fx;
    fy += weight * other.fy;
    fz += weight * other.fz;
    torque += weight * other.torque;
  }
};

/// Direction of the elementary forces (formats.md): Fx = -Ft cos - Fr sin, Fy = +Ft sin - Fr cos, Fz = +Fa.
CuttingForce toolForce(double ft, double fr, double fa, double immersion_angle, double radius);

/// Force of a rigid tool without runout over the spindle angle: chip thickness c sin(phi), integrated along
/// the helix in closed form between the exact entry and exit of each tooth (Dunwoody eq. 3.13..3.15,
/// 5.64..5.67); inclined edges and a helix angle of each tooth as slices (EdgeSlice).
class MechanisticForce {
 public:
  /// @throws Error naming an invalid tool, engagement or coefficient, and on a serrated edge, whose chip is
  /// another one.
  MechanisticForce(const ToolGeometry& tool, const CuttingCoefficients& coefficients,
                   const Engagement& engagement);

  /// @param spindle_angle [rad] immersion angle of tooth 1 at its tip.
  CuttingForce at(double spindle_angle) const;

  /// Mean over a revolution in closed form; independent of the helix.
  CuttingForce mean() const;

 private:
  ToolGeometry tool_;
  CuttingCoefficients coefficients_;
  Engagement engagement_;
  std::vector<MechanisticForce> slices_;  // straight mills; empty: the edge is straight
  std::vector<double> turn_;              // [rad] by which tooth 1 of each slice lags behind the tip
};

/// Checks: @throws Error naming the quantity and its value.
void validate(const ToolGeometry& tool);
void validate(const EdgeShape& edge, const ToolGeometry& tool);
void validate(const Engagement& engagement);

/// Linear map of the six coefficients (ktc, krc, kac, kte, kre, kae) to the mean force over a revolution: row
/// 0..2 fx, fy, fz [N], row 3 torque [N m]. With uneven pitch the feed of each tooth is in proportion to its
/// pitch. Inclined edges as slices (EdgeSlice). @throws Error on a serrated edge.
std::array<std::array<double, 6>, 4> meanForceMatrix(const ToolGeometry& tool, const Engagement& engagement);

}  // namespace smartmill
