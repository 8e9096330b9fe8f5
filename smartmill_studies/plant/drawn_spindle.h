#pragma once

#include <cmath>
#include <random>

#include "plant/beam.h"

namespace smartmill::plant {

/// Draws the spindle of a tool; the tool is not changed.
inline void drawSpindle(std::mt19937_64& random, ToolInSpindle& tool) {
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  tool.spindle_mass = between(8.0, 25.0);
  tool.mass_behind = between(0.10, 0.22);
  tool.spindle_inertia = tool.spindle_mass * std::pow(between(0.07, 0.14), 2);
  tool.stiffness_across = between(4e7, 1.5e8);
  tool.spring_behind = between(0.06, 0.2);
  tool.stiffness_tilting = between(5e5, 2.5e6);
  tool.damping_ratio = between(0.012, 0.04);
}

}  // namespace smartmill::plant
