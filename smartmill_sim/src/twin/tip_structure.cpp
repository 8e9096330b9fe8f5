#include "smartmill_sim/twin/tip_structure.h"

namespace smartmill::sim {

TipStructure::TipStructure(const ToolTip& tip, double rate)
    : vibrates_(!tip.x.modes.empty() || !tip.y.modes.empty()),
      axis_{{ModalFilter(tip.x, rate, Hold::first_order), ModalFilter(tip.y, rate, Hold::first_order)}} {
}

TipMobility TipStructure::predict(bool with_rate, const Vector& external, ToolMotion& motion) const {
  TipMobility mobility;
  for (std::size_t a = 0; a < 2; ++a) {
    const double force = 2.0 * force_[a][0] - force_[a][1];
    motion.displacement[a] = axis_[a].peek(force);
    if (!with_rate) continue;
    motion.rate[a] = axis_[a].peekRate(force);
    mobility.rate_per_force[a] = axis_[a].rateOfInput();
    mobility.assumed_force[a] = force - external[a];
  }
  return mobility;
}

TipStructure::Vector TipStructure::step(const Vector& before, const Vector& force, bool jumps,
                                        bool extrapolate) {
  Vector displacement{};
  for (std::size_t a = 0; a < 2; ++a) {
    displacement[a] = jumps ? axis_[a].jump(before[a], force[a]) : axis_[a].step(before[a]);
    force_[a] = {{force[a], extrapolate ? force_[a][0] : force[a]}};
  }
  return displacement;
}

}  // namespace smartmill::sim
