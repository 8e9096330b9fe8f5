#pragma once

#include "smartmill_core/cutting/tool_profile.h"

namespace smartmill::program {

/// What a tool removes, and what must not meet material.
struct ToolShape {
  explicit ToolShape(const ToolProfile& edges) : profile(edges) {}

  ToolProfile profile;
  double holder_radius = 0.0;  ///< [m] 0: no holder
  double holder_height = 0.0;  ///< [m] of its lower end above the tip
};

}  // namespace smartmill::program
