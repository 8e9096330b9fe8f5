#include "smartmill_kalman/following/speed_tracker.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

/// Mean square of the innovations over the noise that is still noise.
constexpr double USUAL = 2.0;
/// Mean square of a slope over that of noise alone that makes it one.
constexpr double CLEAR = 10.0;
/// Revolutions after a change of the force in which the amplitudes rise.
constexpr double RISE = 1.5;
/// Load takes speed when it comes or goes; then the speed settles within QUIETENS and what is left is QUIET
/// of the acceleration.
constexpr double QUIETENS = 0.2, QUIET = 0.1;  // [s], [1]
/// Standard deviations that the speed may be off, and revolutions that it may stay there.
constexpr double MOST = 3.0, LOST = 3.0;

}  // namespace

void SpeedTrackerParameters::validate() const {
  checkBounds(*this);
}

SpeedTracker::SpeedTracker(const SpeedTrackerParameters& parameters, double speed, double sample_rate)
    : dt_(1.0 / sample_rate), nominal_(speed), speed_(speed) {
  parameters.validate();
  require("spindle speed [rad/s]", speed, Range::positive());
  most_variance_ = std::pow(parameters.speed_std * speed, 2);
  const double acceleration = std::pow(parameters.acceleration_std * speed, 2);
  decay_ = std::exp(-dt_ / parameters.acceleration_memory);
  drive_ = acceleration * (1.0 - decay_ * decay_);
  p_[1][1] = most_variance_;
  wait_ = RISE * units::TWO_PI / speed;
  p_[2][2] = acceleration;
}

void SpeedTracker::predict(double speed_used, double memory) {
  wait_ -= dt_;
  const double keep = std::exp(-dt_ / memory);
  phase_ = keep * phase_ + (speed_ - speed_used) * dt_;
  speed_ += acceleration_ * dt_;
  // The speed is known to a few of its standard deviations; what stays beyond has lost its way.
  const double most = MOST * std::sqrt(most_variance_);
  if (std::abs(speed_ - nominal_) < most) {
    beyond_ = 0.0;
  } else {
    speed_ = std::clamp(speed_, nominal_ - most, nominal_ + most);
    beyond_ += dt_;
    if (beyond_ > LOST * units::TWO_PI / nominal_) {
      speed_ = nominal_;
      acceleration_ = beyond_ = 0.0;
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
  const double share = std::max(QUIET, std::exp(std::min(0.0, wait_) / QUIETENS));
  p_[2][2] += share * share * drive_;
  // While nothing cuts nothing is learnt: the speed does not become less known than it was.
  if (p_[1][1] > most_variance_) {
    const double scale = std::sqrt(most_variance_ / p_[1][1]);
    for (int j = 0; j < 3; ++j) p_[1][j] *= scale;
    for (int j = 0; j < 3; ++j) p_[j][1] *= scale;
  }
}

void SpeedTracker::update(std::size_t axis, double innovation, double slope, double noise_rms,
                          double slope_noise) {
  // Over a quarter of a revolution. What exceeds the noise is no noise but a force that changes: it stays for
  // the filters' memory, so that many samples say it only once.
  const double share = std::min(1.0, 4.0 * nominal_ / units::TWO_PI * dt_);
  const double left = innovation - slope * phase_;
  lately_[axis] += share * (left * left - lately_[axis]);
  slope_[axis] += share * (slope * slope - slope_[axis]);
  // A slope made of noise leads astray, and so do amplitudes that still rise.
  if (wait_ > 0.0 || slope_[axis] < CLEAR * slope_noise * slope_noise) return;
  const double white = noise_rms * noise_rms;
  const double noise = white + std::max(0.0, lately_[axis] - USUAL * white) / share;
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
  p_[1][1] = most_variance_;
  phase_ = 0.0;
  wait_ = RISE * units::TWO_PI / nominal_;
}

double SpeedTracker::speedStd() const {
  return std::sqrt(std::max(0.0, p_[1][1]));
}

}  // namespace smartmill::kalman
