#pragma once

#include <array>

#include "smartmill_core/cutting/rigid_cut.h"

namespace smartmill::loadmeter {

/// Torque per unit of Ktc and of Kte of a rigid tool with runout (effects.md): tooth t cuts at radius R + x
/// cos(position of t) + y sin(position of t).
class RunoutTorque {
 public:
  /// @param x, y [m] offset cos(angle), offset sin(angle).
  RunoutTorque(const ToolGeometry& tool, const Engagement& engagement, double x, double y);

  /// @param spindle_angle [rad] of the tip of tooth 1. @return {[m2], [m]} times radius: N m per N/m2, N/m.
  std::array<double, 2> at(double spindle_angle) const;
  /// Over a revolution.
  std::array<double, 2> mean() const;

 private:
  RigidCut cut_;
};

}  // namespace smartmill::loadmeter
