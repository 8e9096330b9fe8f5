#pragma once

#include <array>

namespace smartmill::sim {

/// Position and velocity of the axes and the spindle.
struct MotionState {
  std::array<double, 3> position{{0, 0, 0}};  ///< [m] machine position of x, y, z
  std::array<double, 3> velocity{{0, 0, 0}};  ///< [m/s]
  double spindle_angle = 0.0;                 ///< [rad] angle of tooth 1, 0..2 pi
  double spindle_speed = 0.0;                 ///< [rad/s] negative: counterclockwise (M4)
  int sequence = 0;                           ///< N word of the running or last block
  int tool = 0;                               ///< T of the tool in the spindle; 0: that of the model
};

}  // namespace smartmill::sim
