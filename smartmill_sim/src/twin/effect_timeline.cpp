#include "smartmill_sim/twin/effect_timeline.h"

namespace smartmill::sim {
namespace {

/// The state without effects.
TwinState nominalStateOf(const MachineModel& model) {
  TwinState state;
  if (model.tool) state.radius = model.tool->radius();
  if (model.tool && model.cutting) state.law.coefficients = *model.cutting;
  return state;
}

}  // namespace

EffectTimeline::EffectTimeline(const MachineModel& model, const MachineModel& changed, int update_steps)
    : effects_(model), nominal_(nominalStateOf(changed)), state_(nominal_), update_steps_(update_steps) {
}

void EffectTimeline::setClock(const Clock& clock) {
  clock_ = clock;
  now_.record_time = 0.0;
  steps_to_update_ = 0;
}

bool EffectTimeline::beginStep(double speed) {
  const bool due = !effects_.empty() && (steps_to_update_ <= 0 || speed != now_.speed);
  if (due) steps_to_update_ = update_steps_;
  --steps_to_update_;
  return due;
}

void EffectTimeline::update(const ToolMotion& motion, const CutProgress& cut) {
  now_.angle = motion.angle;
  now_.speed = motion.speed;
  now_.start_time = clock_.start_time;
  now_.edge_time = clock_.edge_time;
  now_.cut = cut;
  state_ = nominal_;
  effects_.update(now_, state_);
}

void EffectTimeline::setInstant(const ToolMotion& motion, const Axes3& axis_acceleration, double chip,
                                double depth) {
  now_.axis_acceleration = axis_acceleration;
  now_.angle = motion.angle;
  now_.speed = motion.speed;
  now_.chip = chip;
  now_.depth = depth;
}

void EffectTimeline::advance(double time, bool cutting) {
  now_.record_time += time;
  if (clock_.record || cutting) clock_.edge_time += time;
  if (!clock_.record) clock_.start_time += time;
}

}  // namespace smartmill::sim
