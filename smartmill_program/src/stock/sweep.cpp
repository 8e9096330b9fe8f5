#include "smartmill_program/stock/sweep.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::program {

namespace {

/// Place of the minimum of a convex function between two places, from its slope, which may be infinite at the
/// ends: false position with the Illinois rule, bisection where that is not possible.
template <class Slope>
double leastPlace(double low, double high, const Slope& slope) {
  constexpr int MOST = 40;
  constexpr double LEVEL = 1e-4;  // [1] 0.03 nm above the minimum of a sphere of 5 mm
  double at_low = slope(low), at_high = slope(high);
  if (at_low >= 0.0) return low;
  if (at_high <= 0.0) return high;
  double place = low;
  int side = 0;  // of the last place: -1 low, 1 high
  for (int i = 0; i < MOST; ++i) {
    const bool finite = std::isfinite(at_low) && std::isfinite(at_high);
    place = finite ? low + (high - low) * at_low / (at_low - at_high) : 0.5 * (low + high);
    const double here = slope(place);
    if (std::abs(here) < LEVEL) break;
    if (here > 0.0) {
      high = place;
      at_high = here;
      if (side == 1) at_low *= 0.5;
      side = 1;
    } else {
      low = place;
      at_low = here;
      if (side == -1) at_high *= 0.5;
      side = -1;
    }
  }
  return place;
}

}  // namespace

using units::PI;
using units::TWO_PI;

Sweep::Sweep(const nc::PathSegment& path, const ToolProfile& profile)
    : path_(path),
      profile_(profile),
      square_((profile.radius() - SKIN) * (profile.radius() - SKIN)),
      start_z_(path.start()[2]) {
  const double length = path.length();
  if (length == 0.0) return;
  slope_ = (path.target()[2] - start_z_) / length;
  if (path.isArc()) return;
  const double dx = path.target()[0] - path.start()[0], dy = path.target()[1] - path.start()[1];
  const double across = std::hypot(dx, dy);
  share_ = across / length;
  if (across > 0.0) along_ = {dx / across, dy / across};
}

double Sweep::lowestSurface(double x, double y, double from, double to, double bound) const {
  return path_.isArc() ? onArc(x, y, from, to) : onLine(x, y, from, to, bound);
}

template <class Distance, class Growth>
double Sweep::lowestBetween(double low, double high, double nearest, double rise, const Distance& distance,
                            const Growth& growth) const {
  if (low > high) return NONE;
  if (profile_.flat()) return start_z_ + rise * (rise < 0.0 ? high : low);
  double place = std::clamp(nearest, low, high);
  if (rise != 0.0) {
    const auto slope = [&](double at) { return rise + profile_.slope(distance(at)) * growth(at); };
    place = leastPlace(low, high, slope);
  }
  return start_z_ + rise * place + profile_.height(distance(place));
}

double Sweep::onLine(double x, double y, double from, double to, double bound) const {
  const double dx = x - path_.start()[0], dy = y - path_.start()[1];
  const double middle = dx * along_[0] + dy * along_[1];  // horizontal distance of the nearest point
  const double aside = std::max(0.0, dx * dx + dy * dy - middle * middle);
  if (aside >= square_) return NONE;
  if (share_ == 0.0) return std::min(z(from), z(to)) + profile_.height(std::sqrt(aside));
  const double half = std::sqrt(square_ - aside);
  const double low = std::max(middle - half, from * share_), high = std::min(middle + half, to * share_);
  if (low > high) return NONE;
  const double rise = slope_ / share_, nearest = std::clamp(middle, low, high);
  if (!profile_.flat()) {
    const double least = std::sqrt(aside + (nearest - middle) * (nearest - middle));
    if (lowest() + profile_.height(least) >= bound) return NONE;
  }
  if (profile_.ball()) {  // the point of a sphere where its slope is that of the path
    const double depth = profile_.radius() * profile_.radius() - aside;
    const double place = std::clamp(middle - rise * std::sqrt(depth / (1.0 + rise * rise)), low, high);
    return start_z_ + rise * place + profile_.height(std::sqrt(aside + (place - middle) * (place - middle)));
  }
  const auto distance = [&](double place) { return std::sqrt(aside + (place - middle) * (place - middle)); };
  return lowestBetween(low, high, middle, rise, distance,
                       [&](double place) { return (place - middle) / std::max(distance(place), SKIN); });
}

double Sweep::onArc(double x, double y, double from, double to) const {
  const double dx = x - path_.centre()[0], dy = y - path_.centre()[1];
  const double axis = std::hypot(dx, dy), radius = path_.radius();
  const double rate = std::abs(path_.sweep()) / path_.length();  // [rad/m]
  // Law of cosines: the centre of the tool is within the tool's radius for angles nearer than `reach`.
  const double excess = axis * axis + radius * radius - square_, scale = 2.0 * axis * radius;
  if (excess >= scale) return NONE;
  const double reach = excess <= -scale ? PI : std::acos(excess / scale);
  const double turned = std::atan2(dy, dx) - path_.startAngle();
  const double nearest = wrapped(path_.sweep() > 0.0 ? turned : -turned);
  double lowest = NONE;
  for (const double middle : {nearest - TWO_PI, nearest, nearest + TWO_PI}) {
    const double low = std::max(middle - reach, from * rate), high = std::min(middle + reach, to * rate);
    const auto distance = [&](double angle) {
      return std::sqrt(std::max(0.0, axis * axis + radius * radius - scale * std::cos(angle - middle)));
    };
    lowest = std::min(lowest, lowestBetween(low, high, middle, slope_ / rate, distance, [&](double angle) {
                        return 0.5 * scale * std::sin(angle - middle) / std::max(distance(angle), SKIN);
                      }));
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
  const double reach = radius() + sagitta(from, to);
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
  const double reach = radius() + sagitta(from, to);
  return {std::min(a[0], b[0]) - reach, std::max(a[0], b[0]) + reach, std::min(a[1], b[1]) - reach,
          std::max(a[1], b[1]) + reach};
}

bool Sweep::mayReach(double x, double y, double disc_radius) const {
  const double reach = radius() + disc_radius;
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
