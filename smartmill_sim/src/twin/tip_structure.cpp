#include "smartmill_sim/twin/tip_structure.h"

namespace smartmill::sim {

namespace {

std::array<ModalFilter, 2> filtersOf(const ModalModel& x, const ModalModel& y, double rate) {
  return {{ModalFilter(x, rate, Hold::first_order), ModalFilter(y, rate, Hold::first_order)}};
}

}  // namespace

TipStructure::TipStructure(const ToolTip& tip, const WorkpieceModes& workpiece, double rate)
    : vibrates_(!tip.x.modes.empty() || !tip.y.modes.empty() || !workpiece.x.modes.empty() ||
                !workpiece.y.modes.empty()),
      axis_(filtersOf(tip.x, tip.y, rate)),
      workpiece_(filtersOf(workpiece.x, workpiece.y, rate)) {
}

TipMobility TipStructure::predict(bool with_rate, const Vector& external, ToolMotion& motion) const {
  TipMobility mobility;
  for (std::size_t a = 0; a < 2; ++a) {
    const double force = 2.0 * force_[a][0] - force_[a][1];
    const double cutting = force - external[a];
    // The cutting force moves the workpiece in the opposite direction.
    motion.displacement[a] = axis_[a].peek(force) + workpiece_[a].peek(cutting);
    if (!with_rate) continue;
    motion.rate[a] = axis_[a].peekRate(force) + workpiece_[a].peekRate(cutting);
    mobility.rate_per_force[a] = axis_[a].rateOfInput() + workpiece_[a].rateOfInput();
    mobility.assumed_force[a] = cutting;
  }
  return mobility;
}

TipStructure::Displacement TipStructure::step(const Vector& before, const Vector& force,
                                              const Vector& external, bool jumps, bool extrapolate) {
  const auto moved = [jumps](ModalFilter& filter, double from, double to) {
    return jumps ? filter.jump(from, to) : filter.step(from);
  };
  Displacement displacement;
  for (std::size_t a = 0; a < 2; ++a) {
    displacement.tool[a] = moved(axis_[a], before[a], force[a]);
    displacement.relative[a] =
        displacement.tool[a] + moved(workpiece_[a], before[a] - external[a], force[a] - external[a]);
    force_[a] = {{force[a], extrapolate ? force_[a][0] : force[a]}};
  }
  return displacement;
}

}  // namespace smartmill::sim
