#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace smartmill {

/// Axes of machine, force and motion, in the order of every array of three.
constexpr std::array<const char*, 3> AXIS_NAMES{{"x", "y", "z"}};

/// Index in AXIS_NAMES; nothing for any other name.
constexpr std::optional<std::size_t> axisIndex(std::string_view name) {
  for (std::size_t axis = 0; axis < AXIS_NAMES.size(); ++axis)
    if (name == AXIS_NAMES[axis]) return axis;
  return std::nullopt;
}

/// Index of an axis (0, 1, 2) among the axis names of a controller, where it is "X", "Y" or "Z"; nothing
/// where the controller has no such axis.
inline std::optional<std::size_t> controllerAxis(const std::vector<std::string>& names, std::size_t axis) {
  const auto found = std::find(names.begin(), names.end(), std::string(1, static_cast<char>('X' + axis)));
  if (found == names.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names.begin());
}

}  // namespace smartmill
