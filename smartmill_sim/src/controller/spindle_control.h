#pragma once

#include "controller/overrides.h"
#include "smartmill_sim/controller/controller_options.h"
#include "smartmill_sim/controller/spindle_motion.h"

namespace smartmill::sim {

/// The spindle under the words S, M3, M4, M5, M19 and M119 of a program, with override and load. Times [s]
/// are those of the caller's clock and do not decrease.
class SpindleControl {
 public:
  SpindleControl(const ControllerOptions& options, const Overrides& overrides);

  double speed(double time) const { return motion_.speed(time); }  ///< [rad/s]
  double angle(double time) const { return motion_.angle(time); }  ///< [rad]
  double settleTime() const { return motion_.settleTime(); }       ///< [s]
  double programmed() const { return speed_; }                     ///< [rad/s] S, without sign and override
  double commanded() const;                                        ///< [rad/s] with sign and override
  bool atSpeed(double time) const;
  bool oriented(double time) const;

  /// S word. @param speed [rad/s]
  void setSpeed(double speed);
  /// M3 (forwards) or M4.
  void start(bool forwards);
  /// Ramps to the commanded speed if the spindle is on.
  void follow(double time);
  void stop(double time);
  /// Stops and turns to an angle in steps of 1/4096 revolution. @throws NcAlarm on another number of steps
  void orient(double time, double steps);
  /// Torque of the cut [N m].
  void setTorque(double time, double torque);

 private:
  enum class Rotation { off, forwards, backwards };

  const Overrides& overrides_;
  SpindleMotion motion_;
  double max_speed_, drive_acceleration_, drive_torque_;  // [rad/s], [rad/s2], [N m]
  double orient_speed_, speed_tolerance_;                 // [rad/s], [1]
  double speed_ = 0.0;
  Rotation rotation_ = Rotation::off;
  bool oriented_ = false;
  double torque_ = 0.0;
};

}  // namespace smartmill::sim
