#pragma once

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// The surface on which the edges of a rotating mill move: its height above the tip over the distance from
/// the tool axis. End mill: 0 up to the radius; bull nose and ball end: the arc of the corner; face mill: the
/// inclined edge (geometry of EdgeSlice). The height never falls with the distance and is convex.
class ToolProfile {
 public:
  /// A flat end mill. @param radius [m] > 0
  explicit ToolProfile(double radius);
  /// @param height [m] > 0 above the tip up to which an inclined edge extends; above it the tool is a
  /// cylinder
  /// @throws Error on an invalid shape
  ToolProfile(const ToolGeometry& tool, double height);

  double radius() const { return radius_; }           ///< [m] largest
  double flatRadius() const { return flat_radius_; }  ///< [m] of the flat part around the axis
  double top() const { return top_; }  ///< [m] height from which on the radius is the largest; 0: flat end
  bool flat() const { return top_ == 0.0; }
  bool ball() const { return corner_radius_ == radius_; }

  double height(double distance) const;  ///< [m] @param distance [m] 0..radius()
  double slope(double distance) const;   ///< [1] dheight / ddistance, infinite at a vertical side
  double radiusAt(double height) const;  ///< [m] @param height [m] 0..top(), above it: radius()

 private:
  double radius_, flat_radius_, top_ = 0.0;  // [m]
  double corner_radius_ = 0.0;               // [m]
  double corner_end_ = 0.0,
         corner_height_ = 0.0;  // [m] distance from the axis and height of the corner's end
  double tangent_ = 0.0;        // [1] rise of the inclined edge; 0: a vertical one
};

}  // namespace smartmill
