#pragma once

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/tool_history.h"

namespace smartmill::sim {

/// The effects of a machine in time: the present instant, the clocks, and the state as changed by the
/// effects.
class EffectTimeline {
 public:
  /// Times for effects in time. Live: both times advance from here, edge_time only during cutting.
  struct Clock {
    double start_time = 0.0;  ///< [s] since the machine was cold
    double edge_time = 0.0;   ///< [s] cutting time of the edge
    bool record = false;      ///< a record of a campaign: start_time is constant, edge_time always advances
  };

  /// @param model with its effects @param changed by them
  /// @param update_steps between two updates of slow changes, whose times are far above that of a step
  EffectTimeline(const MachineModel& model, const MachineModel& changed, int update_steps = 16);

  const EffectSet& effects() const { return effects_; }
  const Instant& now() const { return now_; }
  const TwinState& state() const { return state_; }
  /// The signal stage at the present instant.
  SignalStage signalStage() { return {effects_, now_}; }

  /// Starts a record: drift and hum restart.
  void setClock(const Clock& clock);
  const Clock& clock() const { return clock_; }
  /// Begins a step. @param speed [rad/s] @return whether update() is required: from time to time, since
  /// effects change slowly, and at another speed
  bool beginStep(double speed);
  /// Computes the state at a motion.
  void update(const ToolMotion& motion, const CutProgress& cut);
  /// The instant of a step. @param chip [m] and depth [m] of the cut, 0 without one
  void setInstant(const ToolMotion& motion, const Axes3& axis_acceleration, double chip, double depth);
  void setAngle(double angle) { now_.angle = angle; }  ///< [rad]
  void advance(double time, bool cutting);

 private:
  EffectSet effects_;
  TwinState nominal_, state_;
  Instant now_;
  Clock clock_;
  int update_steps_, steps_to_update_ = 0;
};

}  // namespace smartmill::sim
