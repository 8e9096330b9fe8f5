#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace smartmill {

/// Axes of machine, force and motion, in the order of every array of three.
constexpr std::array<const char*, 3> AXIS_NAMES{{"x", "y", "z"}};

/// Index in AXIS_NAMES; nothing for any other name.
constexpr std::optional<std::size_t> axisIndex(std::string_view name) {
  for (std::size_t axis = 0; axis < AXIS_NAMES.size(); ++axis)
    if (name == AXIS_NAMES[axis]) return axis;
  return std::nullopt;
}

}  // namespace smartmill
