#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace smartmill {

/// One channel of a force sensor, of one or several sensing elements: what it measures of force and moment.
struct SensorChannel {
  std::string name;
  double force_per_unit = 1.0;                 ///< [N/unit] of the channel's samples, not 0
  std::array<double, 3> direction{{0, 0, 0}};  ///< of the measured force, unit vector
  std::array<double, 3> position{{0, 0, 0}};   ///< [m] where that force acts, from the origin of the moments
  /// [unit/N], [unit/(N m)] measured calibration: response to fx, fy, fz, mx, my, mz, in place of the above;
  /// empty: direction and position are used.
  std::vector<double> response;
};

/// The channels of a force sensor and the components that are estimated from them.
struct SensorChannels {
  std::string unit = "N";               ///< of the samples
  std::size_t components = 6;           ///< 3: forces; 6: forces and moments
  std::optional<double> noise_rms;      ///< [unit] of one sample
  std::vector<SensorChannel> channels;  ///< at least as many as components
};

}  // namespace smartmill
