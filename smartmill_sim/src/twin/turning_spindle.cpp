#include "smartmill_sim/twin/turning_spindle.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill::sim {

ModalModel TurningSpindle::at(double speed, const ModalModel& at_rest) const {
  if (!(reference_speed > 0.0))
    throw Error(formatted("reference_speed: %g, expected a value above 0", reference_speed));
  const double share = speed / reference_speed;
  const double stiffness = 1.0 - softening * share * share, damping = 1.0 + damping_rise * share;
  if (!(stiffness > 0.0) || !(damping > 0.0) || !(gyroscopic >= 0.0))
    throw Error(
        formatted("spindle speed %g rad/s: softening, damping_rise or gyroscopic out of range (stiffness and "
                  "damping must stay above 0)",
                  speed));
  ModalModel turning = at_rest;
  for (Mode& mode : turning.modes) {
    mode.frequency *= std::sqrt(stiffness);
    mode.damping_ratio *= damping;
    mode.gain /= stiffness;
  }
  const double split = gyroscopic * share;
  if (turning.modes.empty() || split == 0.0) return turning;
  const Mode original = turning.modes.front();
  const double middle = std::hypot(1.0, split), backward = middle - split, forward = middle + split;
  Mode whirl[2] = {original, original};
  for (int i = 0; i < 2; ++i) {
    const double ratio = i == 0 ? backward : forward;
    whirl[i].frequency = original.frequency * ratio;
    whirl[i].damping_ratio = original.damping_ratio / middle;
    whirl[i].gain = original.gain / (ratio * 2.0 * middle);
  }
  turning.modes.front() = whirl[0];
  turning.modes.insert(turning.modes.begin() + 1, whirl[1]);
  return turning;
}

MachineModel TurningSpindle::at(double speed, const MachineModel& at_rest) const {
  MachineModel turning = at_rest;
  turning.tool_tip.x = at(speed, at_rest.tool_tip.x);
  turning.tool_tip.y = at(speed, at_rest.tool_tip.y);
  return turning;
}

}  // namespace smartmill::sim
