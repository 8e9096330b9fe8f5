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

/// Force of a rigid tool without runout over the spindle angle: chip thickness c sin(phi), of inclined edges
/// c sin(phi) sin(kappa) + a cos(kappa) with the axial feed per tooth a, integrated along
/// the helix in closed form between the exact entry and exit of each tooth (Dunwoody eq. 3.13..3.15,
/// 5.64..5.67); inclined edges and a helix angle of each tooth as slices (EdgeSlice).
class MechanisticForce {
 public:
  /// @param bottom [m] >= 0, height above the tip at which the cut begins; it ends at the axial depth. Bands
  /// have their own.
  /// @throws Error naming an invalid tool, engagement or coefficient, and on a serrated edge, whose chip is
  /// another one.
  MechanisticForce(const ToolGeometry& tool, const CuttingCoefficients& coefficients,
                   const Engagement& engagement, double bottom = 0.0);

  /// @param spindle_angle [rad] immersion angle of tooth 1 at its tip.
  CuttingForce at(double spindle_angle) const;

  /// Mean over a revolution in closed form; independent of the helix.
  CuttingForce mean() const;

 private:
  ToolGeometry tool_;
  CuttingCoefficients coefficients_;
  Engagement engagement_;
  double bottom_ = 0.0;                   // [m]
  double level_ = 0.0;                    // [m] chip across the tool of an axial feed, per tooth
  std::vector<MechanisticForce> slices_;  // straight mills from their tips up; empty: it is one itself
  std::vector<double> turn_;              // [rad] by which tooth 1 of each slice lags behind the tip
};

/// Checks: @throws Error naming the quantity and its value.
void validate(const ToolGeometry& tool);
void validate(const EdgeShape& edge, const ToolGeometry& tool);
void validate(const Engagement& engagement);

/// Linear map of the six coefficients (ktc, krc, kac, kte, kre, kae) to the mean force over a revolution: row
/// 0..2 fx, fy, fz [N], row 3 torque [N m]. With uneven pitch the feed of each tooth is in proportion to its
/// pitch. Inclined edges as slices (EdgeSlice). @param bottom as of MechanisticForce. @throws Error on a
/// serrated edge.
std::array<std::array<double, 6>, 4> meanForceMatrix(const ToolGeometry& tool, const Engagement& engagement,
                                                     double bottom = 0.0);

}  // namespace smartmill
