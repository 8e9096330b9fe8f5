#pragma once

#include <array>
#include <cstddef>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/effect_timeline.h"
#include "smartmill_sim/twin/flexible_cut.h"
#include "smartmill_sim/twin/measuring_chain.h"

namespace smartmill::sim {

/// Input over one step.
struct CuttingInput : FlexibleCut::Input {
  std::array<double, 3> sensor_force{{0, 0, 0}};  ///< [N] force on the sensor in addition to cutting
  Axes3 axis_acceleration{{0, 0, 0}};             ///< [m/s2] of the machine axes
};

/// The parts of a cutting machine, with the effects that act on them in each step.
struct CuttingParts {
  CuttingParts(const MachineModel& original, const TwinSetup& setup, double time_step, Feed feed,
               int corner_slices);

  /// Applies the effects to the parts.
  void update(const ToolMotion& motion);
  void beginStep(const CuttingInput& input);
  void endSteps(const ToolMotion& motion, std::size_t steps = 1);

  MachineModel model;  ///< as changed by the effects
  double time_step;    ///< [s]
  EffectTimeline timeline;
  FlexibleCut cut;
  MeasuringChain chain;
};

}  // namespace smartmill::sim
