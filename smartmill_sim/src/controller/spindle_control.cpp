#include "controller/spindle_control.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/nc/orientation.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/controller/nc_alarm.h"

namespace smartmill::sim {
SpindleControl::SpindleControl(const ControllerOptions& options, const Overrides& overrides)
    : overrides_(overrides),
      motion_(options.spindle_acceleration),
      max_speed_(options.spindle_max_speed),
      drive_acceleration_(options.spindle_acceleration),
      drive_torque_(options.spindle_torque),
      orient_speed_(options.orient_speed),
      speed_tolerance_(options.speed_tolerance) {
}

double SpindleControl::commanded() const {
  const double speed = std::min(overrides_.spindle(speed_), max_speed_);
  return rotation_ == Rotation::backwards ? -speed : speed;
}

bool SpindleControl::atSpeed(double time) const {
  return rotation_ != Rotation::off &&
         std::abs(speed(time) - commanded()) <= speed_tolerance_ * std::abs(commanded());
}

bool SpindleControl::oriented(double time) const {
  return oriented_ && speed(time) == 0.0 && time >= settleTime();
}

void SpindleControl::setSpeed(double speed) {
  speed_ = std::min(speed, max_speed_);
}

void SpindleControl::start(bool forwards) {
  rotation_ = forwards ? Rotation::forwards : Rotation::backwards;
  oriented_ = false;
}

void SpindleControl::follow(double time) {
  if (rotation_ != Rotation::off) motion_.ramp(time, commanded());
}

void SpindleControl::stop(double time) {
  motion_.ramp(time, 0.0);
  rotation_ = Rotation::off;
}

void SpindleControl::orient(double time, double steps) {
  if (!(steps >= 0.0 && steps <= nc::ORIENT_STEPS - 1))
    throw NcAlarm(PS_MACRO_FORMAT, "#1133 IS NOT 0 TO 4095");
  rotation_ = Rotation::off;
  oriented_ = true;
  motion_.orient(time, units::TWO_PI * steps / nc::ORIENT_STEPS, orient_speed_);
}

void SpindleControl::setTorque(double time, double torque) {
  if (drive_torque_ <= 0.0 || torque == torque_) return;
  torque_ = torque;
  // The drive's torque limit accelerates the inertia and carries the cut; the cut assists braking.
  const double share = torque / drive_torque_;
  motion_.setAccelerations(time, drive_acceleration_ * (1.0 - share),
                           drive_acceleration_ * std::max(1.0 + share, 0.01));
}

}  // namespace smartmill::sim
