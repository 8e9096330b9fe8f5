#include "controller/motor_heating.h"

#include <cmath>

namespace smartmill::sim {

MotorHeating::MotorHeating(const ControllerOptions& options)
    : ambient_(options.motor_temperature),
      load_rise_(options.motor_load_rise),
      idle_rise_(options.motor_idle_rise),
      time_constant_(options.motor_time_constant),
      max_speed_(options.spindle_max_speed),
      axes_{options.motor_temperature, options.motor_temperature, options.motor_temperature},
      spindle_(options.motor_temperature) {
}

void MotorHeating::advance(double time, const std::array<double, 3>& axis_load, double spindle_load,
                           double spindle_speed) {
  const double kept = std::exp(-time / time_constant_);
  const auto follow = [&](double& temperature, double rise) {
    const double steady = ambient_ + rise;
    temperature = steady + kept * (temperature - steady);
  };
  for (std::size_t a = 0; a < 3; ++a) follow(axes_[a], load_rise_ * std::pow(0.01 * axis_load[a], 2));
  follow(spindle_,
         load_rise_ * std::pow(0.01 * spindle_load, 2) + idle_rise_ * std::abs(spindle_speed) / max_speed_);
}

}  // namespace smartmill::sim
