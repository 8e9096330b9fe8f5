#include "smartmill_sim/controller/path_move.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::sim {

PathMove PathMove::line(const Point& start, const Point& target) {
  PathMove move(start);
  move.target_ = target;
  move.length_ = std::hypot(target[0] - start[0], target[1] - start[1], target[2] - start[2]);
  return move;
}

PathMove PathMove::arc(const Point& start, const Point& target, const std::array<double, 2>& centre,
                       bool clockwise) {
  PathMove move(start);
  move.target_ = target;
  move.centre_ = centre;
  move.radius_ = std::hypot(start[0] - centre[0], start[1] - centre[1]);
  move.start_angle_ = std::atan2(start[1] - centre[1], start[0] - centre[0]);
  const double end_angle = std::atan2(target[1] - centre[1], target[0] - centre[0]);
  double sweep = std::fmod(end_angle - move.start_angle_, units::TWO_PI);
  const bool closed = std::hypot(target[0] - start[0], target[1] - start[1]) < 1e-12;
  if (closed) sweep = 0.0;
  if (clockwise) {
    move.sweep_ = sweep < 0.0 ? sweep : sweep - units::TWO_PI;
  } else {
    move.sweep_ = sweep > 0.0 ? sweep : sweep + units::TWO_PI;
  }
  move.length_ = std::hypot(move.radius_ * move.sweep_, target[2] - start[2]);
  return move;
}

void PathMove::plan(double time, double feed, double acceleration) {
  const double done = distance(time), now = speed(time);
  const double remaining = std::max(0.0, length_ - done);
  begin_ = time;
  from_distance_ = done;
  acceleration_ = acceleration;
  first_ = now;
  // The ramps need (peak^2 - first^2) / 2a and peak^2 / 2a; a shorter path has a triangular profile.
  peak_ = std::min(feed, std::sqrt(remaining * acceleration + 0.5 * now * now));
  if (feed <= 0.0) {
    peak_ = now;
    ramp_ = steady_ = 0.0;
    end_distance_ = std::min(length_, done + 0.5 * now * now / acceleration);
    if (length_ - end_distance_ < 1e-12) end_distance_ = length_;
  } else {
    end_distance_ = length_;
    ramp_ = std::abs(peak_ - now) / acceleration;
    const double ramps = 0.5 * (std::abs(peak_ * peak_ - now * now) + peak_ * peak_) / acceleration;
    steady_ = peak_ > 0.0 ? std::max(0.0, (remaining - ramps) / peak_) : 0.0;
  }
  down_ = peak_ / acceleration;
  duration_ = ramp_ + steady_ + down_;
}

void PathMove::stop(double time, double acceleration) {
  plan(time, 0.0, acceleration);
  if (held()) {
    target_ = at(end_distance_);
    sweep_ *= length_ > 0.0 ? end_distance_ / length_ : 0.0;
    length_ = end_distance_;
  }
}

double PathMove::distance(double time) const {
  const double since = time - begin_;
  const double remaining = duration_ - since;
  if (remaining <= 0.0) return end_distance_;
  // Measured from the nearer end, so that both ends are exact.
  if (remaining < down_) return end_distance_ - 0.5 * acceleration_ * remaining * remaining;
  const double a = std::copysign(acceleration_, peak_ - first_);
  if (since < ramp_) return from_distance_ + since * (first_ + 0.5 * a * since);
  return from_distance_ + 0.5 * ramp_ * (first_ + peak_) + peak_ * (since - ramp_);
}

double PathMove::speed(double time) const {
  const double since = time - begin_;
  const double remaining = duration_ - since;
  if (remaining <= 0.0) return 0.0;
  if (remaining < down_) return acceleration_ * remaining;
  return since < ramp_ ? first_ + std::copysign(acceleration_, peak_ - first_) * since : peak_;
}

PathMove::Point PathMove::at(double distance) const {
  if (distance <= 0.0 || length_ == 0.0) return start_;
  if (distance >= length_) return target_;
  const double share = distance / length_;
  Point point;
  // Measured from the nearer end.
  for (std::size_t i = 0; i < 3; ++i) {
    point[i] = share < 0.5 ? start_[i] + share * (target_[i] - start_[i])
                           : target_[i] - (1.0 - share) * (target_[i] - start_[i]);
  }
  if (radius_ > 0.0) {
    const double angle = start_angle_ + share * sweep_;
    point[0] = centre_[0] + radius_ * std::cos(angle);
    point[1] = centre_[1] + radius_ * std::sin(angle);
  }
  return point;
}

PathMove::Point PathMove::direction(double distance) const {
  Point along{{0, 0, 0}};
  if (length_ == 0.0) return along;
  for (std::size_t i = 0; i < 3; ++i) along[i] = (target_[i] - start_[i]) / length_;
  if (radius_ > 0.0) {
    const double share = distance / length_;
    const double angle = start_angle_ + share * sweep_;
    const double rate = radius_ * sweep_ / length_;
    along[0] = -rate * std::sin(angle);
    along[1] = rate * std::cos(angle);
  }
  return along;
}

PathMove::Point PathMove::position(double time) const {
  return at(distance(time));
}

PathMove::Point PathMove::velocity(double time) const {
  const double v = speed(time);
  const Point along = direction(distance(time));
  return {v * along[0], v * along[1], v * along[2]};
}

std::optional<double> PathMove::curveFeed(double acceleration) const {
  return radius_ > 0.0 ? std::optional<double>(std::sqrt(acceleration * radius_)) : std::nullopt;
}

std::array<std::array<double, 2>, 2> PathMove::extent() const {
  std::array<std::array<double, 2>, 2> ends{};
  for (std::size_t i = 0; i < 2; ++i)
    ends[i] = {std::min(start_[i], target_[i]), std::max(start_[i], target_[i])};
  if (radius_ == 0.0) return ends;
  // Extrema of an arc: crossings of the axes through its centre.
  for (int quarter = -8; quarter <= 8; ++quarter) {
    const double angle = 0.5 * units::PI * quarter;
    const double share = (angle - start_angle_) / sweep_;
    if (share > 0.0 && share < 1.0) {
      const std::array<double, 2> point{centre_[0] + radius_ * std::cos(angle),
                                        centre_[1] + radius_ * std::sin(angle)};
      for (std::size_t i = 0; i < 2; ++i)
        ends[i] = {std::min(ends[i][0], point[i]), std::max(ends[i][1], point[i])};
    }
  }
  return ends;
}

}  // namespace smartmill::sim
