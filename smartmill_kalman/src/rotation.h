#pragma once

#include <array>

#include "smartmill_core/signal/streams.h"
#include "smartmill_ros/frames.h"

namespace smartmill::kalman {

/// @param rotation row-major, sensor to machine
inline void rotateInPlace(const std::array<double, 9>& rotation, ForceBlock& block) {
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    const auto turned = frames::rotate(rotation, {block.force[0][i], block.force[1][i], block.force[2][i]});
    for (std::size_t axis = 0; axis < 3; ++axis) block.force[axis][i] = turned[axis];
  }
}

}  // namespace smartmill::kalman
