#include "cutter_compensation.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using nc::PathSegment;
using units::MM;
using Vector = std::array<double, 2>;

constexpr double SAME_POINT = 0.1 * units::UM;  // [m] a tenth of the last digit of a program
constexpr double ROUNDING = 5 * units::UM;      // [m] of tangent transitions, as of arcs (arc.h)
constexpr double ARC_ROUNDING = 0.01;           // [rad] of the sweep of an arc

Vector operator+(const Vector& a, const Vector& b) {
  return {a[0] + b[0], a[1] + b[1]};
}
Vector operator-(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1]};
}
Vector operator*(double s, const Vector& a) {
  return {s * a[0], s * a[1]};
}
double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1];
}
double cross(const Vector& a, const Vector& b) {
  return a[0] * b[1] - a[1] * b[0];
}
double norm(const Vector& a) {
  return std::hypot(a[0], a[1]);
}
Vector leftOf(const Vector& a) {
  return {-a[1], a[0]};
}
Vector flat(const PathSegment::Point& p) {
  return {p[0], p[1]};
}
PathSegment::Point at(const Vector& p, double z) {
  return {p[0], p[1], z};
}

/// Unit tangent of a path in the plane at its start or end.
Vector tangent(const PathSegment& path, bool at_end) {
  const Vector along = flat(path.direction(at_end ? path.length() : 0.0));
  return (1.0 / norm(along)) * along;
}

bool inPlane(const PathSegment& path) {
  return path.isArc() || norm(flat(path.target()) - flat(path.start())) > 0.0;
}

[[noreturn]] void interfere(const Move& move, const std::string& what) {
  throw Error("radius compensation: " + what + " in line " + std::to_string(move.line));
}

/// The point of a line or circle nearest to `corner` that is also on a circle; false: none within ROUNDING.
bool lineCircle(const Vector& point, const Vector& along, const Vector& centre, double radius,
                const Vector& corner, Vector* result) {
  const Vector to_centre = centre - point;
  const Vector foot = point + dot(to_centre, along) * along;
  const double distance = norm(centre - foot);
  if (distance > radius + ROUNDING) return false;
  const double half = std::sqrt(std::max(0.0, radius * radius - distance * distance));
  const Vector a = foot + half * along, b = foot - half * along;
  *result = norm(a - corner) < norm(b - corner) ? a : b;
  return true;
}

/// Intersection nearest to the corner.
bool intersection(const PathSegment& a, const PathSegment& b, const Vector& corner, Vector* result) {
  const Vector a_point = flat(a.target()), b_point = flat(b.start());
  if (!a.isArc() && !b.isArc()) {
    const Vector u = tangent(a, true), v = tangent(b, false);
    *result = a_point + (cross(b_point - a_point, v) / cross(u, v)) * u;
    return true;
  }
  if (!a.isArc()) return lineCircle(a_point, tangent(a, true), b.centre(), b.radius(), corner, result);
  if (!b.isArc()) return lineCircle(b_point, tangent(b, false), a.centre(), a.radius(), corner, result);
  // The chord that two circles share.
  const Vector between = b.centre() - a.centre();
  const double distance = norm(between);
  if (distance < SAME_POINT) return false;
  const double share =
      0.5 * (distance * distance + a.radius() * a.radius() - b.radius() * b.radius()) / distance;
  return lineCircle(a.centre() + (share / distance) * between, (1.0 / distance) * leftOf(between), a.centre(),
                    a.radius(), corner, result);
}

}  // namespace

void CutterCompensation::start(Side side, double radius) {
  if (phase_ == Phase::cancelling)
    throw Error("radius compensation begins before the cancelling move of G40, expected G0 or G1 in X or Y");
  side_ = side == Side::left ? 1.0 : -1.0;
  radius_ = radius;
  phase_ = Phase::starting;
}

void CutterCompensation::cancel() {
  if (phase_ == Phase::starting) phase_ = Phase::off;
  if (phase_ != Phase::on) return;
  const PathSegment path = offset(element_->programmed);
  emitElement(flat(path.target()));
  emitWaiting();
  element_.reset();
  phase_ = Phase::cancelling;
}

void CutterCompensation::forget() {
  if (active()) throw Error("radius compensation is active, expected G40 before this block");
  phase_ = Phase::off;
}

void CutterCompensation::add(const Move& move) {
  if (phase_ == Phase::off || (phase_ == Phase::starting && !inPlane(move.path))) {
    moves_.push_back(move);
    return;
  }
  if (!inPlane(move.path)) {
    if (phase_ == Phase::on) {
      waiting_.push_back(move);
    } else {
      emitHere(move);
    }
    return;
  }
  if (phase_ != Phase::on && move.path.isArc())
    throw Error(move.operation + " as the " + (phase_ == Phase::starting ? "start-up" : "cancelling") +
                " move of radius compensation, expected G0 or G1");
  if (phase_ == Phase::starting) {
    element_ = Element{move, true, flat(move.path.start())};
    phase_ = Phase::on;
  } else if (phase_ == Phase::on) {
    if (move.path.isArc() && move.path.plane() != nc::Plane::xy)
      throw Error("an arc in G18 or G19 under radius compensation, expected G17");
    corner(move);
  } else {
    phase_ = Phase::off;
    emit(move, PathSegment::line(at(at_, move.path.start()[2]), move.path.target()));
  }
}

PathSegment CutterCompensation::offset(const Move& move) const {
  const PathSegment& path = move.path;
  const Vector from = flat(path.start()) + side_ * radius_ * leftOf(tangent(path, false)),
               to = flat(path.target()) + side_ * radius_ * leftOf(tangent(path, true));
  if (!path.isArc()) return PathSegment::line(at(from, path.start()[2]), at(to, path.target()[2]));
  const bool towards_centre = (path.sweep() > 0.0) == (side_ > 0.0);
  if (towards_centre && path.radius() <= radius_ + SAME_POINT)
    interfere(move,
              formatted("radius offset of %.4g mm in an arc of %.4g mm", radius_ / MM, path.radius() / MM));
  return PathSegment::arc(at(from, path.start()[2]), at(to, path.target()[2]), path.centre(),
                          path.sweep() < 0.0);
}

void CutterCompensation::corner(const Move& next) {
  const PathSegment after = offset(next);
  const Vector begin = flat(after.start()), corner = flat(next.path.start());
  Vector from = begin;
  if (element_->start_up) {
    emitElement(begin);
  } else {
    const PathSegment before = offset(element_->programmed);
    const Vector end = flat(before.target());
    const Vector u = tangent(element_->programmed.path, true), v = tangent(next.path, false);
    const double turn = side_ * cross(u, v);
    if (norm(begin - end) < SAME_POINT) {
      emitElement(begin);
    } else if (turn < 0.0 || (dot(u, v) < 0.0 && turn < SAME_POINT / radius_)) {
      emitElement(end);
      const double z = next.path.start()[2];
      emit(element_->programmed, PathSegment::arc(at(end, z), at(begin, z), corner, side_ > 0.0));
    } else {
      if (!intersection(before, after, corner, &from))
        interfere(next, formatted("no intersection of the paths offset by %.4g mm", radius_ / MM));
      emitElement(from);
    }
  }
  at_ = from;
  emitWaiting();
  element_ = Element{next, false, from};
}

void CutterCompensation::emitElement(const Vector& to) {
  const Move& move = element_->programmed;
  const PathSegment& path = move.path;
  const PathSegment::Point from = at(element_->from, path.start()[2]), target = at(to, path.target()[2]);
  const std::string what =
      formatted("a radius offset of %.4g mm is larger than the path permits (interference)", radius_ / MM);
  if (path.isArc()) {
    const PathSegment trimmed = PathSegment::arc(from, target, path.centre(), path.sweep() < 0.0);
    if (std::abs(trimmed.sweep()) > std::abs(path.sweep()) + ARC_ROUNDING) interfere(move, what);
    emit(move, trimmed);
  } else {
    const Vector along = to - element_->from;
    if (!element_->start_up && dot(along, tangent(path, false)) < -SAME_POINT) interfere(move, what);
    if (norm(along) > 0.0 || from[2] != target[2]) emit(move, PathSegment::line(from, target));
  }
  at_ = to;
}

void CutterCompensation::emit(const Move& move, const PathSegment& path) {
  moves_.push_back(move);
  moves_.back().path = path;
  at_ = flat(path.target());
}

void CutterCompensation::emitHere(const Move& move) {
  const double from = move.path.start()[2], to = move.path.target()[2];
  emit(move, from == to ? PathSegment(at(at_, from)) : PathSegment::line(at(at_, from), at(at_, to)));
}

void CutterCompensation::emitWaiting() {
  for (const Move& move : waiting_) emitHere(move);
  waiting_.clear();
}

}  // namespace smartmill::program
