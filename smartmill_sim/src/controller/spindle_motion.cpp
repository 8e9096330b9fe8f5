#include "smartmill_sim/controller/spindle_motion.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"

namespace smartmill::sim {

SpindleMotion::SpindleMotion(double acceleration)
    : drive_(acceleration), up_(acceleration), down_(acceleration), phases_{Phase{0.0, 0.0, 0.0, 0.0}} {
}

void SpindleMotion::setAccelerations(double time, double up, double down) {
  if (up == up_ && down == down_) return;
  const bool was_overloaded = overloaded();
  up_ = up;
  down_ = down;
  if (!orienting_ && (was_overloaded || overloaded() || speed(time) != target_)) plan(time);
}

void SpindleMotion::ramp(double time, double speed) {
  orienting_ = false;
  target_ = speed;
  plan(time);
}

void SpindleMotion::plan(double time) {
  restart(time);
  double now = phases_.back().speed;
  const bool slower = std::abs(target_) < std::abs(now) || target_ * now < 0.0;
  if (slower && now != 0.0) {
    const double next_speed = target_ * now > 0.0 ? target_ : 0.0;
    append(std::abs(now - next_speed) / down_, std::copysign(down_, next_speed - now), next_speed);
    now = next_speed;
  }
  if (overloaded()) {
    if (now != 0.0 && up_ < 0.0) append(std::abs(now / up_), std::copysign(up_, -now), 0.0);
  } else if (now != target_) {
    append(std::abs(target_ - now) / up_, std::copysign(up_, target_ - now), target_);
  }
}

void SpindleMotion::orient(double time, double angle, double turn_speed) {
  up_ = down_ = drive_;
  ramp(time, 0.0);
  orienting_ = true;
  const double rotation = wrapped(angle - phases_.back().angle);
  if (rotation > 0.0) {
    const double peak = std::min(turn_speed, std::sqrt(rotation * drive_));
    const double ramp_time = peak / drive_;
    append(ramp_time, drive_, peak);
    append(std::max(0.0, rotation / peak - ramp_time), 0.0, peak);
    append(ramp_time, -drive_, 0.0);
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
  while (i > 0 && time < phases_[i].start) --i;
  return phases_[i];
}

/// Drops the plan: one phase that begins with the state at a time [s].
void SpindleMotion::restart(double time) {
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
