#include "smartmill_sim/twin/cutting_machine.h"

#include "smartmill_core/error.h"

namespace smartmill::sim {
namespace {

constexpr int UPDATE_STEPS = 16;  // between updates of slow changes

/// The state without effects.
TwinState nominalStateOf(const MachineModel& model) {
  TwinState state;
  if (model.tool) state.radius = model.tool->radius();
  if (model.tool && model.cutting) state.law.coefficients = *model.cutting;
  return state;
}

}  // namespace

CuttingMachine::CuttingMachine(const MachineModel& model, double time_step, Feed feed, int corner_slices)
    : CuttingMachine(model, setUpOf(model, EffectSet(model)), time_step, feed, corner_slices) {
}

CuttingMachine::CuttingMachine(const MachineModel& model, const TwinSetup& setup, double time_step, Feed feed,
                               int corner_slices)
    : effects_(model),
      model_(setup.model),
      time_step_(time_step),
      nominal_(nominalStateOf(setup.model)),
      state_(nominal_),
      cut_(setup, nominal_.law, time_step, feed, corner_slices),
      chain_(setup, time_step) {
}

void CuttingMachine::setClock(const Clock& clock) {
  clock_ = clock;
  now_.record_time = 0.0;
  steps_to_update_ = 0;
}

void CuttingMachine::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise) {
  if (!cut_.canEngage()) throw Error(model_.file + ": tool or cutting is missing (needed to simulate a cut)");
  cut_.contact.engage(arcs, now, rise);
  update(now);
  cut_.engage(now, state_);
}

void CuttingMachine::setDepth(double depth, double passed_over) {
  cut_.contact.setDepth(depth, passed_over);
  cut_.updateDepths(state_);
}

void CuttingMachine::resetLoadMeter(double spindle_speed) {
  if (!model_.spindle) return;
  ToolMotion motion;
  motion.speed = spindle_speed;
  update(motion);
  ChannelValues values{};
  values[LOAD_METER] = chain_.resetLoad(spindle_speed);
  effects_.measure(Stage::sensor_output, now_, values);
  chain_.resetDelay(LOAD_METER, values[LOAD_METER]);
}

void CuttingMachine::update(const ToolMotion& motion) {
  now_.angle = motion.angle;
  now_.speed = motion.speed;
  now_.start_time = clock_.start_time;
  now_.edge_time = clock_.edge_time;
  now_.cut_time = cut_.contact.cutTime();
  state_ = nominal_;
  effects_.update(now_, state_);
  cut_.update(state_);
  chain_.update(state_);
}

CuttingMachine::Output CuttingMachine::step(const Input& input) {
  Output out;
  step(input, out);
  return out;
}

void CuttingMachine::step(const Input& input, Output& out) {
  applyEffects(input);
  out.force = cut_.force(input, state_);
  out.applied = {{out.force.fx + input.sensor_force[0], out.force.fy + input.sensor_force[1],
                  out.force.fz + input.sensor_force[2]}};
  if (effects_.has(Stage::sensor_force)) effects_.addForce(now_, out.applied);
  cut_.moveTip(input, out.force, out.raw);
  chain_.measure(cut_.last(), out.force, cut_.contact.jump(), out.applied, input.motion.speed, out.raw);
  cut_.endStep(out.force);
  if (effects_.has(Stage::sensor_output)) effects_.measure(Stage::sensor_output, now_, out.raw);
  chain_.filter(out.raw);
  ChannelValues measured = out.raw;
  if (effects_.has(Stage::signal)) effects_.measure(Stage::signal, now_, measured);
  out.sensor = {{measured[FX], measured[FY], measured[FZ]}};
  out.load_meter = measured[LOAD_METER];
  out.displacement = {{measured[TOOL_X], measured[TOOL_Y]}};
  advanceTime(input.motion);
}

void CuttingMachine::applyEffects(const Input& input) {
  if (!effects_.empty() && (steps_to_update_ <= 0 || input.motion.speed != now_.speed)) {
    update(input.motion);
    steps_to_update_ = UPDATE_STEPS;
    if (cut_.contact.depthsChange(state_)) cut_.updateDepths(state_);
  }
  --steps_to_update_;
  now_.axis_acceleration = input.axis_acceleration;
  now_.angle = input.motion.angle;
  now_.speed = input.motion.speed;
  now_.chip = now_.depth = 0.0;
  if (!cutting() || now_.speed == 0.0) return;
  now_.chip = cut_.contact.chip(input.motion, model_.tool->teeth);
  now_.depth = cut_.contact.depth();
}

void CuttingMachine::advanceTime(const ToolMotion& motion, std::size_t steps) {
  const double time = static_cast<double>(steps) * time_step_;
  now_.record_time += time;
  if (clock_.record || cutting()) clock_.edge_time += time;
  if (!clock_.record) clock_.start_time += time;
  cut_.contact.advance(time, motion, state_);
}

// Whether no effect changes the state from step to step or depends on the instant of a step.
bool CuttingMachine::replaysWithoutUpdates() const {
  return cut_.replaysAlone() && !(effects_.has(Stage::motion) || effects_.has(Stage::cutting_law) ||
                                  effects_.has(Stage::sensor) || effects_.has(Stage::sensor_force) ||
                                  effects_.has(Stage::drive) || effects_.has(Stage::sensor_output));
}

void CuttingMachine::run(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                         const ChannelRows& raw) {
  // Channels that are not requested may act on requested ones.
  const bool mixes = effects_.has(Stage::sensor_output) || chain_.mixes();
  std::array<std::vector<double>, LOAD_METER + 1> unrequested;
  ChannelRows rows = raw;
  for (std::size_t c = 0; c < unrequested.size() && mixes; ++c) {
    if (rows[c]) continue;
    unrequested[c].resize(steps);
    rows[c] = &unrequested[c];
  }
  History history;
  simulateCut(steps, next, rows, history);
  chain_.measure(history, now_.speed, rows);
  applyOutputEffects(history.instants, rows);
  chain_.filter(steps, rows);
}

void CuttingMachine::simulateCut(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                                 const ChannelRows& raw, History& history) {
  const bool has_sensor_force = effects_.has(Stage::sensor_force),
             has_output_effects = effects_.has(Stage::sensor_output);
  history.before = cut_.last();
  history.force.resize(steps);
  if (has_sensor_force) history.applied.resize(steps);
  if (has_output_effects) history.instants.resize(steps);
  cut_.reserveTrace(steps);
  Input input;
  Output out;
  const bool replays_rest = replaysWithoutUpdates();
  for (std::size_t k = 0; k < steps; ++k) {
    if (replays_rest && cutting() && cut_.contact.jump() == 0.0) {
      cut_.replay(k, history, raw);
      next(steps - 1, input);
      now_.angle = input.motion.angle;
      advanceTime(input.motion, steps - k);
      return;
    }
    next(k, input);
    applyEffects(input);
    if (has_output_effects) history.instants[k] = now_;
    out.force = history.force[k] = cut_.force(input, state_);
    if (has_sensor_force) {
      history.applied[k] = {{out.force.fx, out.force.fy, out.force.fz}};
      effects_.addForce(now_, history.applied[k]);
    }
    cut_.moveTip(input, out.force, out.raw);
    for (const std::size_t c : {TOOL_X, TOOL_Y}) {
      if (raw[c]) (*raw[c])[k] = out.raw[c];
    }
    if (cut_.contact.jump() != 0.0) history.jumps.emplace_back(k, cut_.contact.jump());
    cut_.endStep(out.force);
    advanceTime(input.motion);
  }
}

void CuttingMachine::applyOutputEffects(const std::vector<Instant>& instants, const ChannelRows& raw) const {
  for (std::size_t k = 0; k < instants.size(); ++k) {
    ChannelValues values{};
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (raw[c]) values[c] = (*raw[c])[k];
    }
    effects_.measure(Stage::sensor_output, instants[k], values);
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (raw[c]) (*raw[c])[k] = values[c];
    }
  }
}

}  // namespace smartmill::sim
