#include "smartmill_sim/world/stock_contact.h"

#include <algorithm>
#include <cmath>

#include "smartmill_sim/controller/nc_alarm.h"

namespace smartmill::sim {
namespace {

constexpr double TURNING = 1.0;      // [rad/s] a slower spindle cannot cut
constexpr double SAME_ANGLE = 1e-7;  // [rad]

/// Along the tool axis, steeper than a ramp, whose material the side of the tool removes.
bool plunges(const Axes3& velocity) {
  constexpr double STEEPEST = 0.2;  // [1] of a ramp: 11 degrees
  return velocity[2] < -STEEPEST * std::hypot(velocity[0], velocity[1]);
}

bool isSameContact(const std::vector<ContactArc>& a, const std::vector<ContactArc>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const ContactArc& p, const ContactArc& q) {
    return std::abs(p.entry - q.entry) < SAME_ANGLE && std::abs(p.exit - q.exit) < SAME_ANGLE &&
           p.depth == q.depth && p.bottom == q.bottom;
  });
}

}  // namespace

StockContact::Fault StockContact::update(const MotionState& state, const ToolMotion& now,
                                         CuttingMachine& machine) {
  Fault fault;
  std::vector<ContactArc> arcs = stock_.contact(state.position, state.velocity);
  if (!arcs.empty() && state.spindle_speed < TURNING) {
    fault = {EX_TOUCHED, "TOOL MET STOCK WITH SPINDLE AT REST"};
  } else if (plunges(state.velocity) && stock_.hasMaterialAbove(state.position)) {
    fault = {EX_PLUNGED, "TOOL PLUNGED INTO STOCK"};
  }
  if (fault.alarm != 0) arcs.clear();
  if (!arcs.empty() || machine.cutting()) {
    stock_.cutTo(state.position);
  } else {
    stock_.endSlot();
  }
  if (!isSameContact(arcs, arcs_)) {
    arcs_ = arcs;
    machine.engage(arcs, now);
  }
  return fault;
}

}  // namespace smartmill::sim
