#pragma once

#include <array>
#include <cstddef>

namespace smartmill::nc {

/// Plane of an arc: G17, G18 or G19.
enum class Plane { xy, zx, yz };

/// First and second axis of a plane, in the order in which counterclockwise is positive, and the third axis
/// (0 x, 1 y, 2 z).
struct PlaneAxes {
  std::size_t first, second, third;
};
constexpr PlaneAxes axesOf(Plane plane) {
  return plane == Plane::xy   ? PlaneAxes{0, 1, 2}
         : plane == Plane::zx ? PlaneAxes{2, 0, 1}
                              : PlaneAxes{1, 2, 0};
}

/// A straight line, or an arc in a plane whose third coordinate is in proportion to the path (helix).
class PathSegment {
 public:
  using Point = std::array<double, 3>;  ///< [m]

  /// A point.
  explicit PathSegment(const Point& point) : start_(point), target_(point) {}
  static PathSegment line(const Point& start, const Point& target);
  /// @param centre [m] first and second axis of the plane. @param clockwise seen against the third axis; a
  /// target equal to the start in the plane is a full circle
  static PathSegment arc(const Point& start, const Point& target, const std::array<double, 2>& centre,
                         bool clockwise, Plane plane = Plane::xy);

  double length() const { return length_; }  ///< [m]
  const Point& start() const { return start_; }
  const Point& target() const { return target_; }
  Point at(double distance) const;         ///< @param distance [m] from the start, limited to the path
  Point direction(double distance) const;  ///< unit vector; 0 for a point
  /// The path up to a distance [m].
  PathSegment upTo(double distance) const;

  bool isArc() const { return radius_ > 0.0; }
  Plane plane() const { return plane_; }
  const std::array<double, 2>& centre() const { return centre_; }  ///< [m] of an arc
  double radius() const { return radius_; }                        ///< [m] 0: a line
  double startAngle() const { return start_angle_; }               ///< [rad] of the start about the centre
  double sweep() const { return sweep_; }                          ///< [rad] positive: counterclockwise

 private:
  Point start_{{0, 0, 0}}, target_{{0, 0, 0}};
  double length_ = 0.0;
  Plane plane_ = Plane::xy;
  std::array<double, 2> centre_{{0, 0}};
  double radius_ = 0.0, start_angle_ = 0.0, sweep_ = 0.0;
};

}  // namespace smartmill::nc
