#include "smartmill_sim/twin/spindle_drive.h"

#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::sim {

SpindleDrive::SpindleDrive(const Spindle& spindle, double time_step)
    : spindle_(spindle), decay_(std::exp(-units::TWO_PI * spindle.load_meter_bandwidth * time_step)) {
}

void SpindleDrive::setFriction(double extra, double factor) {
  extra_ = extra;
  factor_ = factor;
}

double SpindleDrive::steady(double speed) const {
  return spindle_.load_meter_gain * friction(speed) * speed;
}

void SpindleDrive::reset(double speed) {
  voltage_ = steady(speed);
}

double SpindleDrive::rounded(double voltage) const {
  const double resolution = spindle_.load_meter_resolution;
  return resolution > 0.0 ? std::round(voltage / resolution) * resolution : voltage;
}

}  // namespace smartmill::sim
