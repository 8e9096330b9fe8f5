#include "smartmill_sim/controller/path_move.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::sim {

PathMove PathMove::line(const Point& start, const Point& target) {
  PathMove move(start);
  move.path_ = nc::PathSegment::line(start, target);
  return move;
}

PathMove PathMove::arc(const Point& start, const Point& target, const std::array<double, 2>& centre,
                       bool clockwise) {
  PathMove move(start);
  move.path_ = nc::PathSegment::arc(start, target, centre, clockwise);
  return move;
}

void PathMove::plan(double time, double feed, double acceleration) {
  const double done = distance(time), now = speed(time);
  const double remaining = std::max(0.0, length() - done);
  begin_ = time;
  from_distance_ = done;
  acceleration_ = acceleration;
  first_ = now;
  // The ramps need (peak^2 - first^2) / 2a and peak^2 / 2a; a shorter path has a triangular profile.
  peak_ = std::min(feed, std::sqrt(remaining * acceleration + 0.5 * now * now));
  if (feed <= 0.0) {
    peak_ = now;
    ramp_ = steady_ = 0.0;
    end_distance_ = std::min(length(), done + 0.5 * now * now / acceleration);
    if (length() - end_distance_ < 1e-12) end_distance_ = length();
  } else {
    end_distance_ = length();
    ramp_ = std::abs(peak_ - now) / acceleration;
    const double ramps = 0.5 * (std::abs(peak_ * peak_ - now * now) + peak_ * peak_) / acceleration;
    steady_ = peak_ > 0.0 ? std::max(0.0, (remaining - ramps) / peak_) : 0.0;
  }
  down_ = peak_ / acceleration;
  duration_ = ramp_ + steady_ + down_;
}

void PathMove::stop(double time, double acceleration) {
  plan(time, 0.0, acceleration);
  if (held()) path_ = path_.upTo(end_distance_);
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

PathMove::Point PathMove::position(double time) const {
  return path_.at(distance(time));
}

PathMove::Point PathMove::velocity(double time) const {
  const double v = speed(time);
  const Point along = path_.direction(distance(time));
  return {v * along[0], v * along[1], v * along[2]};
}

std::optional<double> PathMove::curveFeed(double acceleration) const {
  return path_.isArc() ? std::optional<double>(std::sqrt(acceleration * path_.radius())) : std::nullopt;
}

std::array<std::array<double, 2>, 2> PathMove::extent() const {
  std::array<std::array<double, 2>, 2> ends{};
  for (std::size_t i = 0; i < 2; ++i)
    ends[i] = {std::min(path_.start()[i], path_.target()[i]), std::max(path_.start()[i], path_.target()[i])};
  if (!path_.isArc()) return ends;
  // Extrema of an arc: crossings of the axes through its centre.
  for (int quarter = -8; quarter <= 8; ++quarter) {
    const double angle = 0.5 * units::PI * quarter;
    const double share = (angle - path_.startAngle()) / path_.sweep();
    if (share > 0.0 && share < 1.0) {
      const std::array<double, 2> point{path_.centre()[0] + path_.radius() * std::cos(angle),
                                        path_.centre()[1] + path_.radius() * std::sin(angle)};
      for (std::size_t i = 0; i < 2; ++i)
        ends[i] = {std::min(ends[i][0], point[i]), std::max(ends[i][1], point[i])};
    }
  }
  return ends;
}

}  // namespace smartmill::sim
