#pragma once

#include <array>
#include <vector>

#include "smartmill_core/cutting/tool_profile.h"
#include "smartmill_program/stock/stock.h"

namespace smartmill::program {

/// Interval of immersion angles in which a range of the tool's height meets material.
struct EngagedArc {
  double entry = 0.0, exit = 0.0;  ///< [rad] 0 <= entry < exit <= pi
  double bottom = 0.0, top = 0.0;  ///< [m] above the tip
  double radius = 0.0;             ///< [m] of the tool there
  /// [1] Largest sin(kappa) of the edge: chip thickness over feed per tooth times sin(phi).
  double chip_share = 1.0;

  double depth() const { return top - bottom; }  ///< [m]
  double width() const;                          ///< [m] across the feed
};

/// Engagement of a mill at one place of its path. Angles are immersion angles in the feed frame
/// (formats.md): x is the horizontal feed direction, clockwise from +y (for a left-hand tool counterclockwise
/// from -y). Only the half of the circumference ahead, 0..pi, has a chip of the horizontal feed.
struct Contact {
  /// From the tip up, in ascending order of the angle at each height. The side of a cylinder is one height
  /// with arcs of different tops; the curved or inclined part of an edge is divided into slices, of which
  /// those with the same angles are joined.
  std::vector<EngagedArc> arcs;
  double slope = 0.0;      ///< [1] rise of the feed over its horizontal part; 0 without one
  double side_area = 0.0;  ///< [m2] volume removed per length of path by the horizontal feed
  double end_area =
      0.0;  ///< [m2] by a feed along the axis, without the flat part of the end (Stock::faceVolume)

  bool empty() const { return arcs.empty(); }
  double entry() const;       ///< [rad] least
  double exit() const;        ///< [rad] largest
  double axialDepth() const;  ///< [m] from the tip to the highest contact
  double radialDepth()
      const;  ///< [m] largest width across the feed at one height, without the gaps between arcs
};

/// A place of the tool and its feed.
struct ToolPlace {
  std::array<double, 3> tip{{0, 0, 0}};        ///< [m] x, y, z
  std::array<double, 3> direction{{0, 0, 0}};  ///< of the feed, unit vector
  bool left_hand = false;
};

/// @param stock of which the tool has removed what its path up to this place covers
Contact contactOf(const Stock& stock, const ToolProfile& profile, const ToolPlace& place);

}  // namespace smartmill::program
