#include "motion_check.h"

#include <cmath>

#include "smartmill_core/math/angle.h"

namespace smartmill::hammer {

void MotionCheck::expectAngle(double angle) {
  angle_ = angle;
  offset_sum_ = 0.0;
  rest_count_ = 0;
}

void MotionCheck::expectPosition(const Axes3& position, double tolerance) {
  position_ = position;
  tolerance_ = tolerance;
  checks_position_ = true;
  rest_count_ = 0;
}

void MotionCheck::expectStandstill() {
  tolerance_ = 0.0;
  checks_position_ = false;
  rest_count_ = 0;
}

bool MotionCheck::isComplete(const CncState& state, const AxesPosition& axes) {
  bool resting = !state.motion && axes.to_go <= tolerance_;
  for (std::size_t i = 0; i < 3 && checks_position_; ++i)
    resting = resting && std::abs(axes.position[i] - position_[i]) <= tolerance_;
  rest_count_ = resting ? rest_count_ + 1 : 0;
  return rest_count_ >= parameters_.rest_states;
}

bool MotionCheck::isComplete(const SpindleAngle& angle) {
  const double offset = nearAngle(angle.angle, angle_) - angle_;
  if (!(std::abs(offset) <= parameters_.angle_tolerance && std::abs(angle.speed) <= parameters_.zero_speed)) {
    rest_count_ = 0;
    return false;
  }
  offset_sum_ = rest_count_ == 0 ? offset : offset_sum_ + offset;
  if (++rest_count_ < parameters_.rest_readings) return false;
  reached_angle_ = angle_ + offset_sum_ / rest_count_;
  return true;
}

}  // namespace smartmill::hammer
