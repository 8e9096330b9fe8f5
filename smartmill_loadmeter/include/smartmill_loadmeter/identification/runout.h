#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

/// Chip thickness [m] of a tooth at sin(phi) = sine: the least distance to any surface that earlier teeth
/// left; not positive where the tooth misses. Tooth t cuts what tooth t + 1, t + 2, ... ahead of it left, at
/// last what it left itself.
/// @param radius [m] of each tooth, or how much it differs from the nominal one.
inline double chipThickness(const ToolGeometry& tool, double feed_per_tooth, double sine,
                            const std::vector<double>& radius, int tooth) {
  double least = std::numeric_limits<double>::infinity(), feed = 0.0;
  for (int m = 1; m <= tool.teeth; ++m) {
    feed += feed_per_tooth * tool.teeth * tool.pitchOf((tooth + m - 1) % tool.teeth) / units::TWO_PI;
    const double ahead = radius[static_cast<std::size_t>((tooth + m) % tool.teeth)];
    least = std::min(least, feed * sine + radius[static_cast<std::size_t>(tooth)] - ahead);
  }
  return least;
}

}  // namespace smartmill::loadmeter
