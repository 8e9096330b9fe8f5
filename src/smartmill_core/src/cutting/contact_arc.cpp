#include "smartmill_core/cutting/contact_arc.h"

#include <algorithm>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill {
namespace {

constexpr double LARGEST_EXIT = units::TWO_PI + 1e-9;  // [rad] rounded

}  // namespace

void validate(const ContactArc& arc) {
  if (arc.entry >= 0.0 && arc.exit > arc.entry && arc.exit <= LARGEST_EXIT && arc.depth > 0.0) return;
  throw Error(
      formatted("contact arc from %g to %g rad over %g m: expected 0 <= entry < exit <= 2 pi, depth > 0",
                arc.entry, arc.exit, arc.depth));
}

std::vector<ContactArc> contactArcs(const Engagement& engagement, double feed_direction) {
  const double depth = engagement.axial_depth;
  // Immersion angles are counted clockwise, the direction of the feed counter-clockwise.
  const double entry = wrapped(engagement.entry - feed_direction);
  const double exit = engagement.exit + (entry - engagement.entry);
  if (exit <= LARGEST_EXIT) return {{entry, std::min(exit, units::TWO_PI), depth}};
  return {{entry, units::TWO_PI, depth}, {0.0, exit - units::TWO_PI, depth}};
}

}  // namespace smartmill
