#include "smartmill_core/cutting/speed_variation.h"

#include <cmath>

#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::PI;
using units::TWO_PI;

/// Phase of a triangle from its rise through 0, -pi/2 <= value < 3 pi/2.
double sincePhase(double phase) {
  return phase - TWO_PI * std::floor((phase + 0.5 * PI) / TWO_PI);
}

}  // namespace

void SpeedVariation::validate() const {
  require("amplitude of the speed variation", amplitude, Range::openHigh(0.0, 1.0));
  require("ratio of the speed variation", ratio, Range::positive());
}

double SpeedVariation::speed(double turn) const {
  const double phase = ratio * turn;
  if (shape == Shape::sine) return 1.0 + amplitude * std::sin(phase);
  const double p = sincePhase(phase);
  return 1.0 + amplitude * (p < 0.5 * PI ? 2.0 * p / PI : 2.0 - 2.0 * p / PI);
}

double SpeedVariation::angle(double turn) const {
  const double phase = ratio * turn;
  if (shape == Shape::sine) return turn + amplitude / ratio * (1.0 - std::cos(phase));
  const double p = sincePhase(phase);
  return turn + amplitude / ratio * (p < 0.5 * PI ? p * p / PI : 2.0 * p - p * p / PI - 0.5 * PI);
}

double SpeedVariation::turn(double angle) const {
  // The angle is ahead of the turn by no more than the integral of the rising half wave.
  double high = angle, low = angle - 2.0 * amplitude / ratio, turn = 0.5 * (low + high);
  constexpr int MOST = 60;             // halvings to the last digit
  constexpr double TOLERANCE = 1e-15;  // [1] of the angle and of a revolution
  const double enough = TOLERANCE * (std::abs(angle) + TWO_PI);
  for (int i = 0; i < MOST; ++i) {
    const double off = this->angle(turn) - angle;
    if (std::abs(off) <= enough) break;
    (off > 0.0 ? high : low) = turn;
    turn -= off / speed(turn);
    if (!(turn > low && turn < high)) turn = 0.5 * (low + high);
  }
  return turn;
}

double SpeedVariation::acceleration(double mean) const {
  return (shape == Shape::sine ? 1.0 : 2.0 / PI) * amplitude * ratio * mean * mean;
}

}  // namespace smartmill
