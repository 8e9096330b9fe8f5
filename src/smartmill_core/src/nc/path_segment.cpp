#include "smartmill_core/nc/path_segment.h"

#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::nc {

PathSegment PathSegment::line(const Point& start, const Point& target) {
  PathSegment path(start);
  path.target_ = target;
  path.length_ = std::hypot(target[0] - start[0], target[1] - start[1], target[2] - start[2]);
  return path;
}

PathSegment PathSegment::arc(const Point& start, const Point& target, const std::array<double, 2>& centre,
                             bool clockwise, Plane plane) {
  const auto [a, b, c] = axesOf(plane);
  PathSegment path(start);
  path.target_ = target;
  path.plane_ = plane;
  path.centre_ = centre;
  path.radius_ = std::hypot(start[a] - centre[0], start[b] - centre[1]);
  path.start_angle_ = std::atan2(start[b] - centre[1], start[a] - centre[0]);
  const double end_angle = std::atan2(target[b] - centre[1], target[a] - centre[0]);
  double sweep = std::fmod(end_angle - path.start_angle_, units::TWO_PI);
  const bool closed = std::hypot(target[a] - start[a], target[b] - start[b]) < 1e-12;
  if (closed) sweep = 0.0;
  if (clockwise) {
    path.sweep_ = sweep < 0.0 ? sweep : sweep - units::TWO_PI;
  } else {
    path.sweep_ = sweep > 0.0 ? sweep : sweep + units::TWO_PI;
  }
  path.length_ = std::hypot(path.radius_ * path.sweep_, target[c] - start[c]);
  return path;
}

PathSegment::Point PathSegment::at(double distance) const {
  if (distance <= 0.0 || length_ == 0.0) return start_;
  if (distance >= length_) return target_;
  const double share = distance / length_;
  Point point;
  // Measured from the nearer end.
  for (std::size_t i = 0; i < 3; ++i) {
    point[i] = share < 0.5 ? start_[i] + share * (target_[i] - start_[i])
                           : target_[i] - (1.0 - share) * (target_[i] - start_[i]);
  }
  if (isArc()) {
    const auto [a, b, c] = axesOf(plane_);
    const double angle = start_angle_ + share * sweep_;
    point[a] = centre_[0] + radius_ * std::cos(angle);
    point[b] = centre_[1] + radius_ * std::sin(angle);
  }
  return point;
}

PathSegment::Point PathSegment::direction(double distance) const {
  Point along{{0, 0, 0}};
  if (length_ == 0.0) return along;
  for (std::size_t i = 0; i < 3; ++i) along[i] = (target_[i] - start_[i]) / length_;
  if (isArc()) {
    const auto [a, b, c] = axesOf(plane_);
    const double share = distance / length_;
    const double angle = start_angle_ + share * sweep_;
    const double rate = radius_ * sweep_ / length_;
    along[a] = -rate * std::sin(angle);
    along[b] = rate * std::cos(angle);
  }
  return along;
}

PathSegment PathSegment::upTo(double distance) const {
  PathSegment part = *this;
  part.target_ = at(distance);
  part.sweep_ *= length_ > 0.0 ? distance / length_ : 0.0;
  part.length_ = distance;
  return part;
}

}  // namespace smartmill::nc
