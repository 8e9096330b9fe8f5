#pragma once

#include <array>
#include <optional>

#include "smartmill_core/nc/path_segment.h"

namespace smartmill::sim {

/// Motion of a point along a path with a trapezoidal speed profile: from the present speed to the feed, to
/// rest exactly at the target. Closed form in time. Times [s] are those of the caller's clock and do not
/// decrease.
class PathMove {
 public:
  using Point = nc::PathSegment::Point;

  /// At rest at a point.
  explicit PathMove(const Point& point) : path_(point) {}
  static PathMove line(const Point& start, const Point& target);
  /// @param centre [m] x, y @param clockwise seen from +z; a target equal to the start is a full circle
  static PathMove arc(const Point& start, const Point& target, const std::array<double, 2>& centre,
                      bool clockwise);

  /// Plans the motion from a time on with a feed [m/s]; 0: brakes to rest on the path, and the rest of the
  /// path remains.
  /// @param acceleration [m/s2] > 0
  void plan(double time, double feed, double acceleration);
  /// Brakes to rest on the path; the point of rest becomes the target.
  void stop(double time, double acceleration);

  double length() const { return path_.length(); }   ///< [m]
  double end() const { return begin_ + duration_; }  ///< [s] when it comes to rest
  /// Whether it comes to rest before the target.
  bool held() const { return end_distance_ < path_.length(); }
  const Point& target() const { return path_.target(); }  ///< [m]
  Point position(double time) const;
  double speed(double time) const;    ///< [m/s] along the path
  Point velocity(double time) const;  ///< [m/s]
  /// Highest feed [m/s] for a centripetal acceleration; nullopt on a line.
  std::optional<double> curveFeed(double acceleration) const;
  /// Lowest and highest x and y of the path [m].
  std::array<std::array<double, 2>, 2> extent() const;

 private:
  double distance(double time) const;

  nc::PathSegment path_;

  // Speed profile: from begin_ a ramp of ramp_ seconds from first_ to peak_, constant for steady_ seconds, a
  // ramp of down_ seconds to rest.
  double begin_ = 0.0, duration_ = 0.0;              // [s]
  double from_distance_ = 0.0, end_distance_ = 0.0;  // [m]
  double first_ = 0.0, peak_ = 0.0;                  // [m/s]
  double ramp_ = 0.0, steady_ = 0.0, down_ = 0.0;    // [s]
  double acceleration_ = 1.0;                        // [m/s2]
};

}  // namespace smartmill::sim
