#include "smartmill_program/stock/sweep.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::program {

using units::PI;
using units::TWO_PI;

Sweep::Sweep(const nc::PathSegment& path, double radius)
    : path_(path), radius_(radius), square_((radius - SKIN) * (radius - SKIN)), start_z_(path.start()[2]) {
  const double length = path.length();
  if (length == 0.0) return;
  slope_ = (path.target()[2] - start_z_) / length;
  if (path.isArc()) return;
  const double dx = path.target()[0] - path.start()[0], dy = path.target()[1] - path.start()[1];
  const double across = std::hypot(dx, dy);
  share_ = across / length;
  if (across > 0.0) along_ = {dx / across, dy / across};
}

double Sweep::lowestTip(double x, double y, double from, double to) const {
  return path_.isArc() ? onArc(x, y, from, to) : onLine(x, y, from, to);
}

double Sweep::onLine(double x, double y, double from, double to) const {
  const double dx = x - path_.start()[0], dy = y - path_.start()[1];
  const double middle = dx * along_[0] + dy * along_[1];  // horizontal distance of the nearest point
  const double aside = dx * dx + dy * dy - middle * middle;
  if (aside >= square_) return NONE;
  if (share_ == 0.0) return std::min(z(from), z(to));
  const double half = std::sqrt(square_ - aside);
  const double low = std::max(middle - half, from * share_), high = std::min(middle + half, to * share_);
  if (low > high) return NONE;
  return slope_ == 0.0 ? start_z_ : z((slope_ < 0.0 ? high : low) / share_);
}

double Sweep::onArc(double x, double y, double from, double to) const {
  const double dx = x - path_.centre()[0], dy = y - path_.centre()[1];
  const double distance = std::hypot(dx, dy), radius = path_.radius();
  const double rate = std::abs(path_.sweep()) / path_.length();  // [rad/m]
  // Law of cosines: the centre of the tool is within the tool's radius for angles nearer than `reach`.
  const double excess = distance * distance + radius * radius - square_, scale = 2.0 * distance * radius;
  if (excess >= scale) return NONE;
  if (excess <= -scale) return std::min(z(from), z(to));
  const double reach = std::acos(excess / scale);
  const double turned = std::atan2(dy, dx) - path_.startAngle();
  const double nearest = wrapped(path_.sweep() > 0.0 ? turned : -turned);
  double lowest = NONE;
  for (const double middle : {nearest - TWO_PI, nearest, nearest + TWO_PI}) {
    const double low = std::max((middle - reach) / rate, from), high = std::min((middle + reach) / rate, to);
    if (low <= high) lowest = std::min(lowest, z(slope_ < 0.0 ? high : low));
  }
  return lowest;
}

double Sweep::sagitta(double from, double to) const {
  if (!path_.isArc()) return 0.0;
  const double half = 0.5 * std::abs(path_.sweep()) * (to - from) / path_.length();
  return half < 0.5 * PI ? path_.radius() * (1.0 - std::cos(half)) : 2.0 * path_.radius();
}

bool Sweep::rowRange(double y, double from, double to, std::array<double, 2>& range) const {
  const nc::PathSegment::Point a = path_.at(from), b = path_.at(to);
  const double reach = radius_ + sagitta(from, to);
  range = {NONE, -NONE};
  const auto include = [&](double x) { range = {std::min(range[0], x), std::max(range[1], x)}; };
  for (const nc::PathSegment::Point& end : {a, b}) {
    const double square = reach * reach - (y - end[1]) * (y - end[1]);
    if (square < 0.0) continue;
    include(end[0] - std::sqrt(square));
    include(end[0] + std::sqrt(square));
  }
  // Sides of the stadium between the discs at both ends.
  const double dx = b[0] - a[0], dy = b[1] - a[1], across = std::hypot(dx, dy);
  if (across > 0.0 && dy != 0.0) {
    for (const double side : {-reach, reach}) {
      const double share = (y - a[1] - side * dx / across) / dy;
      if (share >= 0.0 && share <= 1.0) include(a[0] - side * dy / across + share * dx);
    }
  }
  return range[0] <= range[1];
}

std::array<double, 4> Sweep::box(double from, double to) const {
  const nc::PathSegment::Point a = path_.at(from), b = path_.at(to);
  const double reach = radius_ + sagitta(from, to);
  return {std::min(a[0], b[0]) - reach, std::max(a[0], b[0]) + reach, std::min(a[1], b[1]) - reach,
          std::max(a[1], b[1]) + reach};
}

bool Sweep::mayReach(double x, double y, double disc_radius) const {
  const double reach = radius_ + disc_radius;
  if (path_.isArc()) {
    const double distance = std::hypot(x - path_.centre()[0], y - path_.centre()[1]);
    if (std::abs(distance - path_.radius()) > reach) return false;
    if (std::abs(path_.sweep()) > PI) return true;
    const std::array<double, 4> limits = box(0.0, length());
    return x > limits[0] - disc_radius && x < limits[1] + disc_radius && y > limits[2] - disc_radius &&
           y < limits[3] + disc_radius;
  }
  const double dx = x - path_.start()[0], dy = y - path_.start()[1];
  const double middle = std::clamp(dx * along_[0] + dy * along_[1], 0.0, share_ * length());
  return std::hypot(dx - middle * along_[0], dy - middle * along_[1]) < reach;
}

}  // namespace smartmill::program
