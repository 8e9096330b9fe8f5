#pragma once

#include <array>
#include <vector>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_program/stock/stock.h"

namespace smartmill::program {

/// Engagement of a flat end mill at one place of its path. Angles are immersion angles in the feed frame
/// (formats.md): x is the horizontal feed direction, clockwise from +y (for a left-hand tool counterclockwise
/// from -y). Only the half of the circumference ahead, 0..pi, has a chip.
struct Contact {
  std::vector<ContactArc> arcs;  ///< in ascending order, each from the tip up

  bool empty() const { return arcs.empty(); }
  double entry() const { return arcs.front().entry; }  ///< [rad] of the first arc
  double exit() const { return arcs.back().exit; }     ///< [rad] of the last arc
  double axialDepth() const;                           ///< [m] largest
  /// [m] Width of the arcs across the feed, without the gaps between them.
  double radialDepth(double radius) const;
  /// [m2] Cross-section of the chip across the feed: the volume removed per length of path.
  double area(double radius) const;
};

/// @param tip [m] x, y, z of the tool tip. @param radius [m] of the tool
/// @param feed_angle [rad] of the horizontal feed direction, counterclockwise from +x of the machine
Contact contactOf(const Stock& stock, const std::array<double, 3>& tip, double radius, double feed_angle,
                  bool left_hand);

}  // namespace smartmill::program
