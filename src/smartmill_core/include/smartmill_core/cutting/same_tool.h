#pragma once

#include <cmath>

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// Whether two tools have the same teeth, diameter, helix and corner, as far as a cutting condition states
/// them.
inline bool isSameTool(const ToolGeometry& a, const ToolGeometry& b) {
  constexpr double SAME_LENGTH = 1e-6, SAME_ANGLE = 1e-4;  // [m], [rad] rounding of files
  return a.teeth == b.teeth && std::abs(a.diameter - b.diameter) <= SAME_LENGTH &&
         std::abs(a.helix - b.helix) <= SAME_ANGLE &&
         std::abs(a.edge.corner_radius - b.edge.corner_radius) <= SAME_LENGTH &&
         std::abs(a.edge.edge_angle - b.edge.edge_angle) <= SAME_ANGLE;
}

}  // namespace smartmill
