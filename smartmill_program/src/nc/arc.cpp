#include "arc.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using nc::PathSegment;
using units::MM;

constexpr double LEAST_TOLERANCE = 5e-6;   // [m]
constexpr double MOST_TOLERANCE = 0.5e-3;  // [m]
constexpr double TOLERANCE_SHARE = 1e-3;   // [1] of the radius
constexpr double SAME_POINT = 1e-9;        // [m] below the last digit of a program

}  // namespace

PathSegment arcByCentre(const PathSegment::Point& start, const PathSegment::Point& target,
                        const CentreOffset& offset, bool clockwise, nc::Plane plane) {
  const auto [a, b, c] = nc::axesOf(plane);
  std::array<double, 2> centre{start[a] + offset.first.value_or(0.0), start[b] + offset.second.value_or(0.0)};
  const double radius = std::hypot(start[a] - centre[0], start[b] - centre[1]);
  const double end_radius = std::hypot(target[a] - centre[0], target[b] - centre[1]);
  if (radius < SAME_POINT) throw Error("arc with radius 0, expected its centre away from its start");
  const double tolerance = std::min(MOST_TOLERANCE, std::max(LEAST_TOLERANCE, TOLERANCE_SHARE * radius));
  if (std::abs(end_radius - radius) > tolerance)
    throw Error(
        formatted("arc does not close: radius %.4f mm at its start, %.4f mm at its end, expected equal radii",
                  radius / MM, end_radius / MM));
  const double dx = target[a] - start[a], dy = target[b] - start[b], chord = std::hypot(dx, dy);
  if (chord < SAME_POINT) {  // a full circle
    PathSegment::Point closed = target;
    closed[a] = start[a];
    closed[b] = start[b];
    return PathSegment::arc(start, closed, centre, clockwise, plane);
  }
  const double along = ((centre[0] - start[a]) * dx + (centre[1] - start[b]) * dy) / chord - 0.5 * chord;
  centre[0] -= along * dx / chord;
  centre[1] -= along * dy / chord;
  return PathSegment::arc(start, target, centre, clockwise, plane);
}

PathSegment arcByRadius(const PathSegment::Point& start, const PathSegment::Point& target, double radius,
                        bool clockwise, nc::Plane plane) {
  const auto [a, b, c] = nc::axesOf(plane);
  const double dx = target[a] - start[a], dy = target[b] - start[b], chord = std::hypot(dx, dy);
  if (chord < SAME_POINT)
    throw Error("arc with R from a point to itself, expected I, J or K for a full circle");
  const double square = radius * radius - 0.25 * chord * chord;
  // A half circle may miss its chord by the rounding of the program.
  if (0.5 * chord > std::abs(radius) + LEAST_TOLERANCE)
    throw Error(formatted("arc does not close: R%.4f mm is below half of the distance of its ends, %.4f mm",
                          std::abs(radius) / MM, 0.5 * chord / MM));
  const double height = std::sqrt(std::max(0.0, square));
  // The centre of a clockwise arc of less than half a circle is on the right of the chord.
  const double side = (clockwise ? -1.0 : 1.0) * (radius > 0.0 ? 1.0 : -1.0);
  const std::array<double, 2> centre{0.5 * (start[a] + target[a]) - side * height * dy / chord,
                                     0.5 * (start[b] + target[b]) + side * height * dx / chord};
  return PathSegment::arc(start, target, centre, clockwise, plane);
}

}  // namespace smartmill::program
