#pragma once

#include <array>
#include <vector>

namespace smartmill::plant {

/// One mode of a force sensor.
struct SensorMode {
  double frequency = 0.0;                   ///< [Hz]
  double damping_ratio = 0.0;               ///< [1]
  std::array<double, 3> input{}, output{};  ///< static response of channel c to force a: output[c] input[a]
};

/// A plate dynamometer: a rigid plate on four equal three-axis springs at its corners; the channels add up
/// the springs' forces. The force acts at a point above the plate.
struct Plate {
  double mass = 0.0;                  ///< [kg]
  std::array<double, 3> size{};       ///< [m] of a homogeneous block
  std::array<double, 3> stiffness{};  ///< [N/m] of each spring along x, y, z
  std::array<double, 3> springs{};    ///< [m] x, y half distances of the springs; z distance below the centre
  std::array<double, 3> force_point{};  ///< [m] from the plate's centre
  double damping_ratio = 0.0;           ///< [1]
};

/// Its six modes, lowest first.
std::vector<SensorMode> modesOf(const Plate& plate);

}  // namespace smartmill::plant
