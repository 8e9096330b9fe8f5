#pragma once

// What the parts of HammerSequence share.

#include <cmath>

namespace smartmill {
namespace hammer {

constexpr const char* AXIS_NAMES[] = {"x", "y", "z"};
/// Share of the sensor's range that counts as its end.
constexpr double RANGE_SHARE = 0.98;

inline double roundTo(double value, double step) {
  return std::round(value / step) * step;
}

}  // namespace hammer
}  // namespace smartmill
