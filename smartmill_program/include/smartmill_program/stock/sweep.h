#pragma once

#include <array>
#include <limits>

#include "smartmill_core/cutting/tool_profile.h"
#include "smartmill_core/nc/path_segment.h"

namespace smartmill::program {

/// The space above the surface of a tool that moves along a line, or along an arc about the tool axis
/// (helix). The wall of a flat end mill is in closed form and thus exact; the lowest surface of other tools
/// on a ramp is the root of a monotonic derivative.
class Sweep {
 public:
  static constexpr double NONE = std::numeric_limits<double>::infinity();
  /// [m] by which the tool is smaller in the tests: a point on its circumference is outside despite rounding.
  static constexpr double SKIN = 1e-9;

  /// @param path a line, or an arc in the plane xy
  Sweep(const nc::PathSegment& path, const ToolProfile& profile);

  const nc::PathSegment& path() const { return path_; }
  const ToolProfile& profile() const { return profile_; }
  double radius() const { return profile_.radius(); }                       ///< [m] of the tool
  double length() const { return path_.length(); }                          ///< [m]
  double z(double distance) const { return start_z_ + slope_ * distance; }  ///< [m] of the tip
  double slope() const { return slope_; }                                   ///< [1] rise per path length
  double lowest() const { return slope_ < 0.0 ? z(length()) : start_z_; }   ///< [m]

  /// [m] Lowest height of the tool's surface at the point (x, y) between two distances along the path; NONE:
  /// the tool never covers it, or not below `bound` [m].
  double lowestSurface(double x, double y, double from, double to, double bound = NONE) const;

  /// Range of x [m] at a y that contains all points covered between two distances. @return false: none
  bool rowRange(double y, double from, double to, std::array<double, 2>& range) const;
  /// Box {x low, x high, y low, y high} [m] of the points covered between two distances.
  std::array<double, 4> box(double from, double to) const;
  /// Whether a disc may contain covered points; true in doubt.
  bool mayReach(double x, double y, double disc_radius) const;

 private:
  double onLine(double x, double y, double from, double to, double bound) const;
  double onArc(double x, double y, double from, double to) const;
  // [m] Lowest surface between two places of the path, of which the tip at 0 is at the height of the start
  // and rises by `rise` per unit. @param distance [m] of the point from the axis at a place, least at
  // `nearest`
  // @param growth [m per unit] of the distance
  template <class Distance, class Growth>
  double lowestBetween(double low, double high, double nearest, double rise, const Distance& distance,
                       const Growth& growth) const;
  // [m] the largest distance of the path between two distances from its chord
  double sagitta(double from, double to) const;

  nc::PathSegment path_;
  ToolProfile profile_;
  double square_;                        // [m2] of the radius less SKIN
  double start_z_ = 0.0, slope_ = 0.0;   // [m], [1]
  std::array<double, 2> along_{{0, 0}};  // unit vector of a line's projection
  double share_ = 0.0;                   // [1] horizontal length per path length of a line
};

}  // namespace smartmill::program
