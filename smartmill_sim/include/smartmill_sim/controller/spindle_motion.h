#pragma once

#include <vector>

namespace smartmill::sim {

/// Speed and angle of a spindle that changes its speed with constant acceleration; closed form in time, so
/// that the angle does not drift. Times are those of the caller's clock and do not decrease. A negative speed
/// is counterclockwise (M4).
class SpindleMotion {
 public:
  /// At rest at angle 0. @param acceleration [rad/s2] > 0.
  explicit SpindleMotion(double acceleration);

  /// Accelerations available from a time on [rad/s2]. @param up away from rest; <= 0: the load exceeds the
  /// torque of the drive, and a turning spindle decelerates by |up| @param down towards rest, > 0
  void setAccelerations(double time, double up, double down);

  /// Ramps from a time on [s] to a constant speed [rad/s].
  void ramp(double time, double speed);
  /// Stops, then turns forwards to an angle [rad] (0 <= angle < 2 pi) at up to turn_speed [rad/s], and holds
  /// it.
  void orient(double time, double angle, double turn_speed);

  double settleTime() const { return phases_.back().start; }  ///< [s] from which on the speed is constant
  double speed(double time) const;                            ///< [rad/s]
  double angle(double time) const;                            ///< [rad] 0 <= angle < 2 pi
  bool overloaded() const { return up_ <= 0.0; }

 private:
  /// Constant acceleration from start until the next phase.
  struct Phase {
    double start, angle, speed, acceleration;
  };
  const Phase& phaseAt(double time) const;
  void restart(double time);
  void append(double duration, double acceleration, double end_speed);
  void plan(double time);

  double drive_;               // [rad/s2] without load
  double up_, down_;           // [rad/s2]
  double target_ = 0.0;        // [rad/s]
  bool orienting_ = false;     // the load does not act on an orientation
  std::vector<Phase> phases_;  // never empty; the last has zero acceleration
};

}  // namespace smartmill::sim
