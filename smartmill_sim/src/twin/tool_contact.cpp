#include "smartmill_sim/twin/tool_contact.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::sim {
void ToolContact::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise) {
  if (!feed_start_) feed_start_ = now.centre;
  if (arcs_.empty()) progress_ = {};
  // A contact that only shifts changes the force gradually.
  changed_ = arcs_.empty() != arcs.empty();
  jump_ = 1.0 - rise;
  arcs_ = arcs;
}

void ToolContact::setDepth(double depth, double passed_over) {
  for (ContactArc& a : arcs_) a.depth = depth;
  progress_.path += passed_over;
}

double ToolContact::chip(const ToolMotion& motion, int teeth) {
  const std::array<double, 2>& feed = motion.velocity;
  if (feed[0] != chip_motion_[0] || feed[1] != chip_motion_[1] || motion.speed != chip_motion_[2]) {
    chip_motion_ = {{feed[0], feed[1], motion.speed}};
    chip_ = std::hypot(feed[0], feed[1]) * units::TWO_PI / (std::abs(motion.speed) * teeth);
  }
  return chip_;
}

bool ToolContact::depthsChange(const TwinState& state) const {
  return cutting() && (state.depth_slope != 0.0 || state.depth_extra != depth_extra_);
}

std::vector<ContactArc> ToolContact::actualArcs(const TwinState& state) {
  const double error = state.depth_extra + state.depth_slope * progress_.path;
  depth_extra_ = state.depth_extra;
  std::vector<ContactArc> actual = arcs_;
  if (error == 0.0) return actual;
  for (ContactArc& a : actual) {
    // A band of a curved edge keeps its upper end where another one begins there.
    const bool ends = std::none_of(arcs_.begin(), arcs_.end(),
                                   [&](const ContactArc& above) { return above.bottom == a.depth; });
    if (ends) a.depth = std::max(a.depth + error, a.bottom + SMALLEST_DEPTH);
  }
  return actual;
}

ToolMotion ToolContact::actualMotion(const ToolMotion& commanded, const TwinState& state) const {
  ToolMotion actual = commanded;
  if (state.feed_ratio == 1.0 || !feed_start_) return actual;
  for (std::size_t a = 0; a < 2; ++a) {
    const double start = (*feed_start_)[a];
    actual.centre[a] = start + state.feed_ratio * (commanded.centre[a] - start);
    actual.velocity[a] *= state.feed_ratio;
  }
  return actual;
}

void ToolContact::advance(double time, const ToolMotion& motion, const TwinState& state) {
  if (!cutting()) return;
  progress_.time += time;
  progress_.angle += time * std::abs(motion.speed);
  const std::array<double, 2>& v = motion.velocity;
  progress_.path += time * state.feed_ratio * std::hypot(v[0], v[1]);
}

}  // namespace smartmill::sim
