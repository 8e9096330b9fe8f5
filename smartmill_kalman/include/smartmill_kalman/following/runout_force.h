#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill::kalman {

/// fx, fy [N] on a rigid tool over one revolution at evenly spaced spindle angles from zero: linear
/// edge-force model (formats.md), each tooth cuts the surface that the teeth before it have left, h = min
/// over j of (j c sin(phi) + r_k - r_(k+j)), no force where h <= 0.
/// @param radius [m] of each tooth over their mean @param points of a revolution
std::array<std::vector<double>, 2> revolutionForce(const ToolGeometry& tool,
                                                   const CuttingCoefficients& coefficients,
                                                   const Engagement& engagement,
                                                   const std::vector<double>& radius, std::size_t points);

/// Force of a rigid tool with runout, periodic with the revolution: linear edge-force model (formats.md),
/// each tooth cuts the surface that the teeth before it have left, h = min over j of (j c sin(phi) + r_k -
/// r_(k+j)), no force where h <= 0.
class RunoutForce {
 public:
  /// @param runout [m] offset of the tool's axis @param runout_angle [rad] from tooth 1
  RunoutForce(const ToolGeometry& tool, const CuttingCoefficients& coefficients, const Engagement& engagement,
              double runout, double runout_angle);

  /// fx, fy [N] on the tool at a spindle angle [rad].
  std::array<double, 2> at(double spindle_angle) const;

 private:
  std::array<std::vector<double>, 2> table_;  // over a revolution, first point repeated at the end
};

}  // namespace smartmill::kalman
