#pragma once

#include <cstddef>

#include "smartmill_core/units.h"

namespace smartmill {

struct SineCosine {
  double sine, cosine;
};

constexpr std::size_t REVOLUTION_NODES = 2048;
constexpr double REVOLUTION_NODE_ANGLE = units::TWO_PI / REVOLUTION_NODES;

/// Sine and cosine at REVOLUTION_NODES + 1 angles over a revolution, both ends included.
const SineCosine* sineCosineTable();

/// For 0 <= angle <= 4 pi, within 1e-12: third-order expansion about the nearest node.
inline SineCosine sineCosine(double angle) {
  static const SineCosine* const TABLE = sineCosineTable();
  const auto node = static_cast<std::size_t>(angle * (1.0 / REVOLUTION_NODE_ANGLE) + 0.5);
  const double d = angle - static_cast<double>(node) * REVOLUTION_NODE_ANGLE;
  const SineCosine& at = TABLE[node & (REVOLUTION_NODES - 1)];
  const double c = 1.0 - 0.5 * d * d, s = d * (1.0 - d * d * (1.0 / 6.0));
  return {at.sine * c + at.cosine * s, at.cosine * c - at.sine * s};
}

/// Sine and cosine of an angle plus a small angle d (|d| <= 0.2), within 1e-11.
inline SineCosine turned(const SineCosine& at, double d) {
  const double d2 = d * d;
  const double c = 1.0 - 0.5 * d2 * (1.0 - d2 * (1.0 / 12.0) * (1.0 - d2 * (1.0 / 30.0) * (1.0 - d2 / 56.0)));
  const double s = d * (1.0 - d2 * (1.0 / 6.0) * (1.0 - d2 * (1.0 / 20.0) * (1.0 - d2 * (1.0 / 42.0))));
  return {at.sine * c + at.cosine * s, at.cosine * c - at.sine * s};
}

}  // namespace smartmill
