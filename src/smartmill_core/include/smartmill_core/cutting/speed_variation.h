#pragma once

namespace smartmill {

/// Periodic variation of the spindle speed about its mean: speed = mean x (1 + amplitude s(p)) with the phase
/// p = ratio x turn and turn = mean speed x time [rad]. s is a sine or a triangle of amplitude 1 that rises
/// from 0 at p = 0.
struct SpeedVariation {
  enum class Shape { sine, triangle };

  double amplitude = 0.0;  ///< [1] of the mean speed, 0 <= value < 1
  double ratio = 0.1;      ///< [1] > 0, frequency of the variation over that of the mean spindle speed
  Shape shape = Shape::sine;

  /// @throws Error naming the quantity and its value.
  void validate() const;
  double speed(double turn) const;  ///< [1] over the mean
  double angle(double turn) const;  ///< [rad] of the spindle since turn 0
  double turn(double angle) const;  ///< [rad] inverse of angle()
  /// [rad/s2] Largest acceleration of the spindle at a mean speed [rad/s].
  double acceleration(double mean) const;
};

}  // namespace smartmill
