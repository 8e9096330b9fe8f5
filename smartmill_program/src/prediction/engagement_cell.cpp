#include "smartmill_program/prediction/engagement_cell.h"

#include <algorithm>
#include <cmath>

#include "feed_frame.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

constexpr double ARC_STEP = 5.0;     // [deg]
constexpr double SAME_ANGLE = 0.05;  // [deg] rounding of a contact at a multiple of ARC_STEP

}  // namespace

EngagementCell EngagementCell::of(const Contact& contact, double feed_angle, bool left_hand) {
  EngagementCell cell;
  cell.entry = static_cast<int>(std::floor((units::degFromRad(contact.entry()) + SAME_ANGLE) / ARC_STEP));
  cell.exit =
      std::max(cell.entry + 1,
               static_cast<int>(std::ceil((units::degFromRad(contact.exit()) - SAME_ANGLE) / ARC_STEP)));
  cell.direction = directionCell(feed_angle);
  cell.left_hand = left_hand;
  return cell;
}

stability::RegenerativeSystem EngagementCell::system(const MachineModel& model) const {
  return systemInFeedFrame(model, entry * ARC_STEP, exit * ARC_STEP, direction, left_hand);
}

bool hasModes(const MachineModel& model) {
  return !model.tool_tip.x.modes.empty() || !model.tool_tip.y.modes.empty() || !model.workpiece_modes.empty();
}

}  // namespace smartmill::program
