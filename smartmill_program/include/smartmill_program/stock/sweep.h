#pragma once

#include <array>
#include <limits>

#include "smartmill_core/nc/path_segment.h"

namespace smartmill::program {

/// The space above a flat end mill that moves along a line, or along an arc about the tool axis (helix). All
/// tests are in closed form, so the wall that a sweep leaves is exact.
class Sweep {
 public:
  static constexpr double NONE = std::numeric_limits<double>::infinity();
  /// [m] by which the tool is smaller in the tests: a point on its circumference is outside despite rounding.
  static constexpr double SKIN = 1e-9;

  /// @param path a line, or an arc in the plane xy @param radius [m] of the tool > 0
  Sweep(const nc::PathSegment& path, double radius);

  const nc::PathSegment& path() const { return path_; }
  double radius() const { return radius_; }                                 ///< [m]
  double length() const { return path_.length(); }                          ///< [m]
  double z(double distance) const { return start_z_ + slope_ * distance; }  ///< [m] of the tip
  double slope() const { return slope_; }                                   ///< [1] rise per path length
  double lowest() const { return slope_ < 0.0 ? z(length()) : start_z_; }   ///< [m]

  /// [m] Lowest tip while the tool covers the point (x, y) between two distances along the path; NONE: it
  /// never does.
  double lowestTip(double x, double y, double from, double to) const;

  /// Range of x [m] at a y that contains all points covered between two distances. @return false: none
  bool rowRange(double y, double from, double to, std::array<double, 2>& range) const;
  /// Box {x low, x high, y low, y high} [m] of the points covered between two distances.
  std::array<double, 4> box(double from, double to) const;
  /// Whether a disc may contain covered points; true in doubt.
  bool mayReach(double x, double y, double disc_radius) const;

 private:
  double onLine(double x, double y, double from, double to) const;
  double onArc(double x, double y, double from, double to) const;
  // [m] the largest distance of the path between two distances from its chord
  double sagitta(double from, double to) const;

  nc::PathSegment path_;
  double radius_, square_;               // [m], [m2] less SKIN
  double start_z_ = 0.0, slope_ = 0.0;   // [m], [1]
  std::array<double, 2> along_{{0, 0}};  // unit vector of a line's projection
  double share_ = 0.0;                   // [1] horizontal length per path length of a line
};

}  // namespace smartmill::program
