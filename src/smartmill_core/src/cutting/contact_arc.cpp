#include "smartmill_core/cutting/contact_arc.h"

#include <algorithm>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill {
namespace {

constexpr double LARGEST_EXIT = units::TWO_PI + 1e-9;  // [rad] rounded

}  // namespace

void validate(const ContactArc& arc) {
  if (arc.entry >= 0.0 && arc.exit > arc.entry && arc.exit <= LARGEST_EXIT && arc.bottom >= 0.0 &&
      arc.depth > arc.bottom)
    return;
  throw Error(
      formatted("contact arc from %g to %g rad between %g and %g m above the tip: expected 0 <= entry < exit "
                "<= 2 pi, 0 <= lower < upper end",
                arc.entry, arc.exit, arc.bottom, arc.depth));
}

std::vector<ContactArc> contactArcs(const Engagement& engagement, double feed_direction) {
  std::vector<ContactArc> arcs;
  const auto add = [&](const EngagementBand& band) {
    // Immersion angles are counted clockwise, the direction of the feed counter-clockwise.
    const double entry = wrapped(band.entry - feed_direction);
    const double exit = band.exit + (entry - band.entry);
    arcs.push_back({entry, std::min(exit, units::TWO_PI), band.top, band.bottom});
    if (exit > LARGEST_EXIT) arcs.push_back({0.0, exit - units::TWO_PI, band.top, band.bottom});
  };
  if (engagement.bands.empty()) add({engagement.entry, engagement.exit, 0.0, engagement.axial_depth});
  for (const EngagementBand& band : engagement.bands) add(band);
  return arcs;
}

}  // namespace smartmill
