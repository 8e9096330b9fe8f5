#pragma once

#include <array>

namespace smartmill {

/// Channels [N] of a spindle-integrated force sensor: three pairs of preloaded quartz rings, compression
/// positive.
constexpr std::array<const char*, 6> SPINDLE_SENSOR_CHANNELS{{"x1", "x2", "y1", "y2", "z1", "z2"}};

/// Channels [N] of a force sensor, and columns of a campaign's records.
constexpr std::array<const char*, 3> FORCE_CHANNELS{{"fx", "fy", "fz"}};

/// Channels [N, N m] of a dynamometer plate: force, then moment about the sensor's origin.
constexpr std::array<const char*, 6> PLATE_CHANNELS{{"fx", "fy", "fz", "mx", "my", "mz"}};

}  // namespace smartmill
