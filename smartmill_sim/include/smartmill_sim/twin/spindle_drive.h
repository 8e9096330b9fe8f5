#pragma once

#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// Spindle friction and load meter: V = K (T_cut + b w + T_c) w through a first-order lag (Dunwoody
/// eq. 3.1..3.4 and section 3.2.1).
class SpindleDrive {
 public:
  /// @param time_step [s] > 0
  SpindleDrive(const Spindle& spindle, double time_step);

  /// Friction torque [N m] at a speed [rad/s]; zero below friction_zero_below.
  double friction(double speed) const { return spindle_.friction().at(speed, extra_, factor_); }

  /// Friction torque in addition to the model's [N m], and a factor on the total.
  void setFriction(double extra, double factor);

  /// Steady load meter voltage [V] in an air cut at a speed [rad/s].
  double steady(double speed) const;
  /// Sets the load meter to its steady value at a speed [rad/s].
  void reset(double speed);

  /// Load meter voltage [V], unrounded, after one time step under a constant cutting torque [N m]; exact.
  double step(double cutting_torque, double speed) {
    const double steady = spindle_.load_meter_gain * (cutting_torque + friction(speed)) * speed;
    voltage_ = steady + (voltage_ - steady) * decay_;
    return voltage_;
  }

  /// Voltage rounded to the load meter's resolution [V].
  double rounded(double voltage) const;

 private:
  Spindle spindle_;
  double decay_;
  double extra_ = 0.0;  // [N m]
  double factor_ = 1.0;
  double voltage_ = 0.0;
};

}  // namespace smartmill::sim
