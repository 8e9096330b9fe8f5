#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill {

/// An interval of immersion angles at which the teeth meet material, over a height of the tool.
struct ContactArc {
  double entry = 0.0;   ///< [rad] 0..2 pi, clockwise from +y of the machine
  double exit = 0.0;    ///< [rad] > entry, <= 2 pi
  double depth = 0.0;   ///< [m] upper end above the tip
  double bottom = 0.0;  ///< [m] lower end above the tip
};

/// @throws Error on an arc outside 0..2 pi or without height.
void validate(const ContactArc& arc);

/// The arcs of a cut in the machine: one of each band, or two where it contains +y.
/// @param feed_direction [rad] of the feed in the machine, from +x towards +y
std::vector<ContactArc> contactArcs(const Engagement& engagement, double feed_direction);

/// Segment of a tooth's edge inside an arc.
struct EdgeSegment {
  int tooth;
  double from, to;  ///< [rad] immersion angles that it covers
  double height;    ///< [m/rad]; of a straight edge, which is at `to`, [m]
  bool straight;
};

constexpr double LEAST_LAG = 1e-6;  ///< [rad] over the depth; below it the edge is straight

/// @param lag [rad/m] of the edge with height @param tooth_angle [rad] of each tooth relative to the first
/// @param angle [rad] of the first tooth at its tip
template <class Visit>
void forEachEdgeSegment(const std::vector<ContactArc>& arcs, double lag,
                        const std::vector<double>& tooth_angle, double angle, Visit&& visit) {
  for (const ContactArc& arc : arcs) {
    const double rise = arc.depth - arc.bottom, spread = lag * rise;
    const bool straight = spread < LEAST_LAG;
    const double height = straight ? rise : 1.0 / lag;
    for (std::size_t j = 0; j < tooth_angle.size(); ++j) {
      // The edge covers low..tip, from its lower end on; one revolution earlier it may reach into the arc
      // again.
      double tip = wrapped(angle + tooth_angle[j] - lag * arc.bottom);
      for (double low = tip - spread;; tip += units::TWO_PI, low += units::TWO_PI) {
        const double from = std::max(low, arc.entry), to = std::min(tip, arc.exit);
        if (straight ? tip >= arc.entry && tip < arc.exit : to > from)
          visit(EdgeSegment{static_cast<int>(j), from, to, height, straight});
        if (low + units::TWO_PI >= arc.exit) break;
      }
    }
  }
}

}  // namespace smartmill
