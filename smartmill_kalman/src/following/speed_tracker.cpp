#include "smartmill_kalman/following/speed_tracker.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
void SpeedTrackerParameters::validate() const {
  checkBounds(*this);
}

SpeedTracker::SpeedTracker(const SpeedTrackerParameters& parameters, double speed, double sample_rate)
    : parameters_(parameters), dt_(1.0 / sample_rate), nominal_(speed), speed_(speed) {
  parameters.validate();
  require("spindle speed [rad/s]", speed, Range::positive());
  max_variance_ = std::pow(parameters.speed_std * speed, 2);
  const double acceleration = std::pow(parameters.acceleration_std * speed, 2);
  decay_ = std::exp(-dt_ / parameters.acceleration_memory);
  drive_ = acceleration * (1.0 - decay_ * decay_);
  p_[1][1] = max_variance_;
  rise_left_ = parameters_.rise_revolutions * units::TWO_PI / speed;
  p_[2][2] = acceleration;
}

void SpeedTracker::predict(double speed_used, double memory) {
  rise_left_ -= dt_;
  const double keep = std::exp(-dt_ / memory);
  phase_ = keep * phase_ + (speed_ - speed_used) * dt_;
  speed_ += acceleration_ * dt_;
  // The estimate is limited around the nominal speed; at the limit for long, it restarts.
  const double limit = parameters_.max_deviations * std::sqrt(max_variance_);
  if (std::abs(speed_ - nominal_) < limit) {
    at_limit_ = 0.0;
  } else {
    speed_ = std::clamp(speed_, nominal_ - limit, nominal_ + limit);
    at_limit_ += dt_;
    if (at_limit_ > parameters_.max_limit_revolutions * units::TWO_PI / nominal_) {
      speed_ = nominal_;
      acceleration_ = at_limit_ = 0.0;
      resetCovariance();
    }
  }
  acceleration_ *= decay_;
  // P = F P F' with F = [keep dt 0; 0 1 dt; 0 0 decay]
  double fp[3][3];
  for (int j = 0; j < 3; ++j) {
    fp[0][j] = keep * p_[0][j] + dt_ * p_[1][j];
    fp[1][j] = p_[1][j] + dt_ * p_[2][j];
    fp[2][j] = decay_ * p_[2][j];
  }
  for (int i = 0; i < 3; ++i) {
    p_[i][0] = keep * fp[i][0] + dt_ * fp[i][1];
    p_[i][1] = fp[i][1] + dt_ * fp[i][2];
    p_[i][2] = decay_ * fp[i][2];
  }
  const double share =
      std::max(parameters_.load_floor, std::exp(std::min(0.0, rise_left_) / parameters_.load_decay));
  p_[2][2] += share * share * drive_;
  // Without cutting there is no information; the variance of the speed does not exceed its prior.
  if (p_[1][1] > max_variance_) {
    const double scale = std::sqrt(max_variance_ / p_[1][1]);
    for (int j = 0; j < 3; ++j) p_[1][j] *= scale;
    for (int j = 0; j < 3; ++j) p_[j][1] *= scale;
  }
}

void SpeedTracker::update(std::size_t axis, double innovation, double slope, double noise_rms,
                          double slope_noise) {
  // Averaged over a quarter of a revolution. Power above the noise is a changing force: its samples are
  // correlated over the memory of the filters and count as one.
  const double share = std::min(1.0, 4.0 * nominal_ / units::TWO_PI * dt_);
  const double left = innovation - slope * phase_;
  innovation_power_[axis] += share * (left * left - innovation_power_[axis]);
  slope_power_[axis] += share * (slope * slope - slope_power_[axis]);
  // Slopes that are noise, and amplitudes that have not settled, would bias the speed.
  if (rise_left_ > 0.0 || slope_power_[axis] < parameters_.min_slope_ratio * slope_noise * slope_noise)
    return;
  const double white = noise_rms * noise_rms;
  const double noise =
      white + std::max(0.0, innovation_power_[axis] - parameters_.noise_limit * white) / share;
  const double variance = slope * slope * p_[0][0] + noise;
  double gain[3];
  for (int i = 0; i < 3; ++i) gain[i] = p_[i][0] * slope / variance;
  phase_ += gain[0] * left;
  speed_ += gain[1] * left;
  acceleration_ += gain[2] * left;
  const double row[3] = {p_[0][0], p_[0][1], p_[0][2]};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) p_[i][j] -= gain[i] * slope * row[j];
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < i; ++j) p_[i][j] = p_[j][i] = 0.5 * (p_[i][j] + p_[j][i]);
  }
}

void SpeedTracker::resetCovariance() {
  for (auto& row : p_) row[0] = row[1] = 0.0;
  p_[0][1] = p_[0][2] = p_[1][2] = 0.0;
  p_[1][1] = max_variance_;
  phase_ = 0.0;
  rise_left_ = parameters_.rise_revolutions * units::TWO_PI / nominal_;
}

double SpeedTracker::speedStd() const {
  return std::sqrt(std::max(0.0, p_[1][1]));
}

}  // namespace smartmill::kalman
