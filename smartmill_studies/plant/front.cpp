#include "plant/front.h"

#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::plant {
namespace {

double cross(const Point& a, const Point& b) {
  return a.x * b.y - a.y * b.x;
}
Point operator-(const Point& a, const Point& b) {
  return {a.x - b.x, a.y - b.y};
}

// A tool that rotates clockwise passes a before b (less than half a revolution apart).
bool isLater(const Point& b, const Point& a) {
  return cross(a, b) < 0.0;
}

// Distance behind the axis, in radii, beyond which no tooth reaches a corner.
constexpr double FORGOTTEN = 0.3;

}  // namespace

Front::Front(double radius, std::size_t teeth, double step) : teeth_(teeth), radius_(radius) {
  const double behind = std::asin(FORGOTTEN);
  for (double angle = -behind; angle <= units::PI + behind; angle += step)
    insertAfter(last_, {radius * std::sin(angle), radius * std::cos(angle)});
}

std::size_t Front::insertAfter(std::size_t corner, const Point& at) {
  std::size_t fresh = pool_.size();
  if (free_.empty()) {
    pool_.emplace_back();
  } else {
    fresh = free_.back();
    free_.pop_back();
  }
  const std::size_t after = corner == END ? first_ : pool_[corner].after;
  pool_[fresh] = {at, corner, after};
  (corner == END ? first_ : pool_[corner].after) = fresh;
  (after == END ? last_ : pool_[after].before) = fresh;
  ++size_;
  return fresh;
}

void Front::remove(std::size_t corner) {
  const Corner gone = pool_[corner];
  (gone.before == END ? first_ : pool_[gone.before].after) = gone.after;
  (gone.after == END ? last_ : pool_[gone.after].before) = gone.before;
  for (Tooth& t : teeth_) {
    if (t.behind == corner) t.behind = gone.before;
  }
  free_.push_back(corner);
  --size_;
}

void Front::forget(const Point& axis) {
  const double limit = axis.x - FORGOTTEN * radius_;
  while (first_ != END && pool_[first_].after != END && pool_[pool_[first_].after].at.x < limit &&
         pool_[pool_[first_].after].at.y > axis.y)
    remove(first_);
  while (last_ != END && pool_[last_].before != END && pool_[pool_[last_].before].at.x < limit &&
         pool_[pool_[last_].before].at.y < axis.y)
    remove(last_);
}

double Front::pass(std::size_t tooth, const Point& axis, const Point& tip) {
  Tooth& t = teeth_[tooth];
  const Point ray = tip - axis;
  if (ray.x < -0.5 * FORGOTTEN * radius_) {  // behind the tool: a new revolution
    if (t.moving) forget(axis);
    t = Tooth();
    return -radius_;
  }
  const std::size_t begin = t.behind;
  std::size_t next = begin == END ? first_ : pool_[begin].after;
  while (next != END && !isLater(pool_[next].at - axis, ray)) {
    t.behind = next;
    next = pool_[next].after;
  }
  if (t.behind == END || next == END) {
    t.moving = false;
    return -radius_;
  }
  const Point a = pool_[t.behind].at, edge = pool_[next].at - a;
  const double length = std::hypot(ray.x, ray.y);
  const double depth = length - cross(a - axis, edge) / cross(ray, edge) * length;
  if (t.moving && (depth > 0.0 || t.depth > 0.0)) clip(t, begin, next, tip, depth);
  t.tip = tip;
  t.depth = depth;
  t.moving = true;
  return depth;
}

void Front::clip(Tooth& t, std::size_t begin, std::size_t next, const Point& tip, double depth) {
  const Point chord = tip - t.tip;
  const auto crossing = [&] {
    const double share = t.depth / (t.depth - depth);
    return Point{t.tip.x + share * chord.x, t.tip.y + share * chord.y};
  };
  const auto outside = [&](std::size_t corner) { return cross(chord, pool_[corner].at - t.tip) > 0.0; };
  std::size_t corner = begin == END ? first_ : pool_[begin].after;
  std::size_t kept = begin;  // the last remaining corner, after which new ones are inserted
  if (t.depth <= 0.0) {      // into the workpiece: corners before the crossing remain
    for (; corner != next && outside(corner); corner = pool_[corner].after) kept = corner;
    kept = insertAfter(kept, crossing());
  }
  // Inside, the corners on the axis side of the chord are removed; if the tip is still inside, all corners
  // passed.
  while (corner != next && (depth > 0.0 || !outside(corner))) {
    const std::size_t gone = corner;
    corner = pool_[corner].after;
    remove(gone);
  }
  t.behind = insertAfter(kept, depth > 0.0 ? tip : crossing());
  while (pool_[t.behind].after != next) t.behind = pool_[t.behind].after;
}

}  // namespace smartmill::plant
