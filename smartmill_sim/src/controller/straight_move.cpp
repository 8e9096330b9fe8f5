#include "smartmill_sim/controller/straight_move.h"

#include <algorithm>
#include <cmath>

namespace smartmill::sim {
namespace {

double norm(const std::array<double, 3>& v) {
  return std::hypot(v[0], v[1], v[2]);
}

}  // namespace

StraightMove::StraightMove(const std::array<double, 3>& start, const std::array<double, 3>& target,
                           double feed, double acceleration)
    : start_(start), target_(target), acceleration_(acceleration) {
  std::array<double, 3> way{};
  for (std::size_t i = 0; i < 3; ++i) {
    way[i] = target[i] - start[i];
  }
  length_ = norm(way);
  if (length_ == 0.0) {
    return;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    direction_[i] = way[i] / length_;
  }
  // The ramps alone take feed^2 / acceleration; a shorter way has a triangle of speed.
  peak_ = std::min(feed, std::sqrt(length_ * acceleration));
  ramp_up_ = ramp_down_ = peak_ / acceleration;
  steady_ = std::max(0.0, length_ / peak_ - ramp_up_);
}

StraightMove StraightMove::brake(const std::array<double, 3>& start, const std::array<double, 3>& velocity,
                                 double acceleration) {
  StraightMove move(start);
  move.peak_ = norm(velocity);
  if (move.peak_ == 0.0) {
    return move;
  }
  move.acceleration_ = acceleration;
  move.ramp_down_ = move.peak_ / acceleration;
  move.length_ = 0.5 * move.peak_ * move.ramp_down_;
  for (std::size_t i = 0; i < 3; ++i) {
    move.direction_[i] = velocity[i] / move.peak_;
    move.target_[i] = start[i] + move.length_ * move.direction_[i];
  }
  return move;
}

std::array<double, 3> StraightMove::position(double time) const {
  const double left = duration() - time;
  if (left <= 0.0) {
    return target_;
  }
  // From the nearer end, so that both are exact.
  const bool braking = left < ramp_down_;
  double distance = 0.0;
  if (braking) {
    distance = -0.5 * acceleration_ * left * left;
  } else if (time < ramp_up_) {
    distance = 0.5 * acceleration_ * time * time;
  } else {
    distance = peak_ * (time - 0.5 * ramp_up_);
  }
  std::array<double, 3> point = braking ? target_ : start_;
  for (std::size_t i = 0; i < 3; ++i) {
    point[i] += distance * direction_[i];
  }
  return point;
}

double StraightMove::speed(double time) const {
  const double left = duration() - time;
  if (left <= 0.0) {
    return 0.0;
  }
  if (left < ramp_down_) {
    return acceleration_ * left;
  }
  return time < ramp_up_ ? acceleration_ * time : peak_;
}

std::array<double, 3> StraightMove::velocity(double time) const {
  const double v = speed(time);
  return {v * direction_[0], v * direction_[1], v * direction_[2]};
}

}  // namespace smartmill::sim
