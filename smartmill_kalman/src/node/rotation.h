#pragma once

#include <array>
#include <vector>

#include "smartmill_core/frames.h"

namespace smartmill::kalman {

/// @param rotation row-major, sensor to machine @param force x, y, z samples
inline void rotateInPlace(const std::array<double, 9>& rotation, std::array<std::vector<double>, 3>& force) {
  for (std::size_t i = 0; i < force[0].size(); ++i) {
    const auto turned = frames::rotate(rotation, {force[0][i], force[1][i], force[2][i]});
    for (std::size_t axis = 0; axis < 3; ++axis) force[axis][i] = turned[axis];
  }
}

}  // namespace smartmill::kalman
