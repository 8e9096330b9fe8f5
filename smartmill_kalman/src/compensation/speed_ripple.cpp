#include "smartmill_kalman/compensation/speed_ripple.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::kalman {

void SpeedRipple::add(const SpindleAngle& reading) {
  if (!(reading.speed > 0.0)) return reset();
  steady_.add(reading);
  changed_ = changed_ || !steady_.isSteadyAt(reading.stamp);
  const double change = std::abs(reading.speed - speed_) / reading.speed;
  if (rippling_ && change > std::max(tolerance_, options_.max_deviation * rms_)) {
    candidate_ = rippling_ = false;
    return restart(reading);
  }
  if (count_ == 0 || reading.stamp < last_) return restart(reading);
  const double t = reading.stamp - first_.stamp, v = reading.speed - first_.speed;
  ++count_;
  last_ = reading.stamp;
  t_ += t;
  tt_ += t * t;
  v_ += v;
  tv_ += t * v;
  vv_ += v * v;
  if (count_ >= options_.min_readings && t >= std::max(options_.window, units::TWO_PI / reading.speed)) {
    complete();
    restart(reading);
  }
}

void SpeedRipple::restart(const SpindleAngle& reading) {
  first_ = reading;
  last_ = reading.stamp;
  count_ = 1;
  changed_ = false;
  t_ = tt_ = v_ = tv_ = vv_ = 0.0;
}

void SpeedRipple::complete() {
  const auto n = static_cast<double>(count_);
  const double spread = tt_ - t_ * t_ / n, covariance = tv_ - t_ * v_ / n;  // > 0: t is not constant
  const double slope = covariance / spread;
  const double squares = std::max(0.0, vv_ - v_ * v_ / n - slope * covariance);
  const double mean = first_.speed + v_ / n;
  const double rms = std::sqrt(squares / n) / mean;
  const double largest = options_.max_change * rms;
  const bool steady = std::abs(slope) * (last_ - first_.stamp) / mean <= largest;
  const bool agrees = std::abs(mean / speed_ - 1.0) <= largest;  // speed_ is 0 before the first window
  const bool rippled = candidate_;
  candidate_ = steady && (changed_ || (rippling_ && rms > options_.release * tolerance_));
  rippling_ = candidate_ && rippled && agrees;
  rms_ = rms;
  speed_ = mean;
}

}  // namespace smartmill::kalman
