#pragma once

#include <vector>

namespace smartmill::sim {

/// Speed and angle of a spindle that changes its speed with a constant acceleration; closed form in time, so
/// that an angle does not drift however long the spindle turns. Times are those of the caller's clock and
/// never go back. A negative speed turns backwards.
class SpindleMotion {
 public:
  /// At rest at angle 0. @param acceleration [rad/s2] > 0.
  explicit SpindleMotion(double acceleration);

  /// What the drive can do from time on [rad/s2]. @param up away from rest; 0 or less: the load is more than
  /// the drive can carry, a spindle that turns gets slower by that @param down towards rest, > 0.
  void setAccelerations(double time, double up, double down);

  /// From time on [s] to a speed [rad/s], which is kept.
  void ramp(double time, double speed);
  /// Stops, then turns forwards to an angle [rad] (0 <= angle < 2 pi) at not more than turn_speed [rad/s],
  /// holds it.
  void orient(double time, double angle, double turn_speed);

  double settled() const { return phases_.back().start; }  ///< [s] from when on the speed is constant
  double speed(double time) const;                         ///< [rad/s]
  double angle(double time) const;                         ///< [rad] 0 <= angle < 2 pi
  bool overloaded() const { return up_ <= 0.0; }

 private:
  /// Constant acceleration from start until the next phase.
  struct Phase {
    double start, angle, speed, acceleration;
  };
  const Phase& phaseAt(double time) const;
  void begin(double time);
  void append(double duration, double acceleration, double end_speed);
  void plan(double time);

  double drive_;               // [rad/s2] without load
  double up_, down_;           // [rad/s2]
  double target_ = 0.0;        // [rad/s]
  bool orienting_ = false;     // the load does not disturb that
  std::vector<Phase> phases_;  // never empty; the last has no acceleration
};

}  // namespace smartmill::sim
