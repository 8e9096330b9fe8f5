#pragma once

#include <array>

#include "smartmill_sim/controller/controller_options.h"

namespace smartmill::sim {

/// First-order heating of the motors: the loss grows with the square of the load (copper), in the spindle
/// also with the speed (iron, bearings).
class MotorHeating {
 public:
  explicit MotorHeating(const ControllerOptions& options);

  /// @param time [s] step. @param axis_load, spindle_load [percent]. @param spindle_speed [rad/s]
  void advance(double time, const std::array<double, 3>& axis_load, double spindle_load,
               double spindle_speed);

  const std::array<double, 3>& axes() const { return axes_; }  ///< [deg C]
  double spindle() const { return spindle_; }                  ///< [deg C]

 private:
  double ambient_, load_rise_, idle_rise_, time_constant_, max_speed_;
  std::array<double, 3> axes_;
  double spindle_;
};

}  // namespace smartmill::sim
