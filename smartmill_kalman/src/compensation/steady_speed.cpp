#include "smartmill_kalman/compensation/steady_speed.h"

#include <cmath>

namespace smartmill::kalman {
namespace {

constexpr double STEADY_TIME = 0.05;  // [s] without a change before the speed counts as steady

}  // namespace

void SteadySpeed::add(const SpindleAngle& angle) {
  if (reference_ > 0.0 && std::abs(angle.speed / reference_ - 1.0) > tolerance_) {
    changing_until_ = angle.stamp + STEADY_TIME;
    reference_stamp_ = NEVER;
  }
  if (reference_ == 0.0 || angle.stamp - reference_stamp_ >= STEADY_TIME) {
    reference_ = angle.speed;
    reference_stamp_ = angle.stamp;
  }
}

}  // namespace smartmill::kalman
