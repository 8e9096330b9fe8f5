#pragma once

#include <vector>

namespace smartmill::sim {

/// Speed and angle of a spindle that changes its speed with one acceleration; closed form in time, so that an
/// angle does not drift however long the spindle turns. Times are those of the caller's clock and never go
/// back.
class SpindleMotion {
 public:
  /// At rest at angle 0. @param acceleration [rad/s2] > 0.
  explicit SpindleMotion(double acceleration);

  /// From time on [s] to a speed [rad/s], which is kept.
  void ramp(double time, double speed);
  /// Stops, then turns forwards to an angle [rad] (0 <= angle < 2 pi) at not more than turn_speed [rad/s],
  /// holds it.
  void orient(double time, double angle, double turn_speed);

  double settled() const { return phases_.back().start; }  ///< [s] from when on the speed is constant
  double speed(double time) const;                         ///< [rad/s]
  double angle(double time) const;                         ///< [rad] 0 <= angle < 2 pi

 private:
  /// Constant acceleration from start until the next phase.
  struct Phase {
    double start, angle, speed, acceleration;
  };
  const Phase& phaseAt(double time) const;
  void begin(double time);
  void append(double duration, double acceleration, double end_speed);

  double acceleration_;
  std::vector<Phase> phases_;  // never empty; the last has no acceleration
};

}  // namespace smartmill::sim
