#include "smartmill_sim/controller/spindle_motion.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"

namespace smartmill::sim {

SpindleMotion::SpindleMotion(double acceleration)
    : acceleration_(acceleration), phases_{Phase{0.0, 0.0, 0.0, 0.0}} {
}

void SpindleMotion::ramp(double time, double speed) {
  begin(time);
  const double change = speed - phases_.back().speed;
  append(std::abs(change) / acceleration_, std::copysign(acceleration_, change), speed);
}

void SpindleMotion::orient(double time, double angle, double turn_speed) {
  ramp(time, 0.0);
  const double way = wrapped(angle - phases_.back().angle);
  if (way > 0.0) {
    const double peak = std::min(turn_speed, std::sqrt(way * acceleration_));
    const double ramp_time = peak / acceleration_;
    append(ramp_time, acceleration_, peak);
    append(std::max(0.0, way / peak - ramp_time), 0.0, peak);
    append(ramp_time, -acceleration_, 0.0);
  }
  phases_.back().angle = angle;
}

double SpindleMotion::speed(double time) const {
  const Phase& phase = phaseAt(time);
  return phase.speed + phase.acceleration * (time - phase.start);
}

double SpindleMotion::angle(double time) const {
  const Phase& phase = phaseAt(time);
  const double since = time - phase.start;
  return wrapped(phase.angle + since * (phase.speed + 0.5 * phase.acceleration * since));
}

const SpindleMotion::Phase& SpindleMotion::phaseAt(double time) const {
  std::size_t i = phases_.size() - 1;
  while (i > 0 && time < phases_[i].start) {
    --i;
  }
  return phases_[i];
}

/// Forgets what was planned: one phase from the state at time on.
void SpindleMotion::begin(double time) {
  const Phase now{time, angle(time), speed(time), 0.0};
  phases_.assign(1, now);
}

void SpindleMotion::append(double duration, double acceleration, double end_speed) {
  Phase& last = phases_.back();
  last.acceleration = acceleration;
  const double angle = last.angle + duration * (last.speed + 0.5 * acceleration * duration);
  phases_.push_back({last.start + duration, wrapped(angle), end_speed, 0.0});
}

}  // namespace smartmill::sim
