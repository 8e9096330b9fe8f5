#include "smartmill_program/engagement/contact.h"

#include <algorithm>
#include <cmath>

#include "surroundings.h"

namespace smartmill::program {

double EngagedArc::width() const {
  return radius * (std::cos(entry) - std::cos(exit));
}

double Contact::entry() const {
  double least = arcs.front().entry;
  for (const EngagedArc& arc : arcs) least = std::min(least, arc.entry);
  return least;
}

double Contact::exit() const {
  double most = arcs.front().exit;
  for (const EngagedArc& arc : arcs) most = std::max(most, arc.exit);
  return most;
}

double Contact::axialDepth() const {
  double depth = 0.0;
  for (const EngagedArc& arc : arcs) depth = std::max(depth, arc.top);
  return depth;
}

double Contact::radialDepth() const {
  double most = 0.0, width = 0.0, bottom = 0.0;
  for (const EngagedArc& arc : arcs) {
    width = arc.bottom == bottom ? width + arc.width() : arc.width();
    bottom = arc.bottom;
    most = std::max(most, width);
  }
  return most;
}

Contact contactOf(const Stock& stock, const ToolProfile& profile, const ToolPlace& place) {
  Contact contact;
  const Surroundings around(stock, place);
  if (!profile.flat()) addCurvedContact(around, profile, contact);
  if (around.share() > LEVEL) {
    contact.slope = around.rise() / around.share();
    for (const EngagedArc& arc : cylinderArcs(around, profile.radius(), profile.top())) {
      contact.side_area += arc.width() * arc.depth() * around.share();
      // A side that continues the slice below it.
      EngagedArc* below = contact.arcs.size() == 1 ? &contact.arcs.back() : nullptr;
      if (below && below->top == arc.bottom && sameAngles(*below, arc)) {
        below->top = arc.top;
        below->chip_share = 1.0;
      } else {
        contact.arcs.push_back(arc);
      }
    }
  }
  return contact;
}

}  // namespace smartmill::program
