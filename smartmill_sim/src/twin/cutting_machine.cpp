#include "smartmill_sim/twin/cutting_machine.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr int UPDATE_STEPS = 16;  // between updates of slow changes

}  // namespace

CuttingMachine::CuttingMachine(const MachineModel& model, double time_step, Feed feed, int corner_slices)
    : CuttingMachine(model, setUpOf(model, EffectSet(model)), time_step, feed, corner_slices) {
}

CuttingMachine::CuttingMachine(const MachineModel& model, const TwinSetup& setup, double time_step, Feed feed,
                               int corner_slices)
    : effects_(model),
      model_(setup.model),
      time_step_(time_step),
      tip_(setup.model.tool_tip, 1.0 / time_step),
      chain_(setup, time_step) {
  if (model_.tool) nominal_.radius = model_.tool->radius();
  if (model_.tool && model_.cutting) {
    nominal_.law.coefficients = model_.needCutting("simulate a cut");
    const bool tables = feed == Feed::steady && !vibrates();
    cutter_.emplace(*model_.tool, nominal_.law, time_step, setup.radius_offset, setup.corner_radius,
                    setup.path_share, tables ? Cutter::Method::tables : Cutter::Method::history,
                    corner_slices);
    layers_ = EdgeLayers(setup, nominal_.law, time_step, tables);
  }
  state_ = nominal_;
}

void CuttingMachine::setClock(const Clock& clock) {
  clock_ = clock;
  now_.record_time = 0.0;
  steps_to_update_ = 0;
}

void CuttingMachine::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise) {
  if (!cutter_) throw Error(model_.file + ": tool or cutting is missing (needed to simulate a cut)");
  contact_.engage(arcs, now, rise);
  update(now);
  const std::vector<ContactArc> actual = contact_.actualArcs(state_);
  if (replaysTrace()) return;
  cutter_->engage(actual, contact_.actualMotion(now, state_));
  layers_.engage(actual, contact_.actualMotion(now, state_));
}

void CuttingMachine::setActualDepths() {
  std::vector<double> depths;
  for (const ContactArc& a : contact_.actualArcs(state_)) depths.push_back(a.depth);
  if (!cutter_ || replaysTrace()) return;
  cutter_->setDepths(depths);
  layers_.setDepths(depths);
}

void CuttingMachine::setDepth(double depth, double passed_over) {
  contact_.setDepth(depth, passed_over);
  setActualDepths();
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
  now_.cut_time = contact_.cutTime();
  state_ = nominal_;
  effects_.update(now_, state_);
  if (cutter_) cutter_->setLaw(state_.law);
  layers_.setLaw(state_.law);
  chain_.update(state_);
}

CuttingMachine::Output CuttingMachine::step(const Input& input) {
  Output out;
  step(input, out);
  return out;
}

void CuttingMachine::step(const Input& input, Output& out) {
  applyEffects(input);
  out.force = cuttingForce(input);
  out.applied = {{out.force.fx + input.sensor_force[0], out.force.fy + input.sensor_force[1],
                  out.force.fz + input.sensor_force[2]}};
  if (effects_.has(Stage::sensor_force)) effects_.addForce(now_, out.applied);
  updateTip(input, out);
  chain_.measure(last_, out.force, contact_.jump(), out.applied, input.motion.speed, out.raw);
  endStep(out.force);
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
    if (contact_.depthsChange(state_)) setActualDepths();
  }
  --steps_to_update_;
  now_.axis_acceleration = input.axis_acceleration;
  now_.angle = input.motion.angle;
  now_.speed = input.motion.speed;
  now_.chip = now_.depth = 0.0;
  if (!cutting() || now_.speed == 0.0) return;
  now_.chip = contact_.chip(input.motion, model_.tool->teeth);
  now_.depth = contact_.depth();
}

CuttingForce CuttingMachine::cuttingForce(const Input& input) {
  if (replaysTrace()) return replayed_->steps.at(replay_index_).force;
  if (!cutter_) return {};
  if (rigid() && state_.feed_ratio == 1.0) {
    CuttingForce force = cutter_->step(input.motion);
    layers_.add(input.motion, force);
    return force;
  }
  ToolMotion motion = contact_.actualMotion(input.motion, state_);
  // The displacement of the tip depends on the force of this step and vice versa.
  TipMobility mobility;
  if (input.tip) {
    motion.displacement = input.tip->displacement;
    motion.rate = input.tip->rate;
  } else if (vibrates()) {
    mobility = tip_.predict(state_.law.damping != 0.0, input.tip_force, motion);
  }
  CuttingForce layers;
  layers_.add(motion, layers);
  mobility.assumed_force[0] -= layers.fx;
  mobility.assumed_force[1] -= layers.fy;
  layers.add(cutter_->step(motion, mobility));
  return layers;
}

void CuttingMachine::updateTip(const Input& input, Output& out) {
  if (rigid()) return;
  ChannelValues& channels = out.raw;
  double acceleration = 0.0;
  if (replaysTrace()) {
    const CutTrace::Step& step = replayed_->steps.at(replay_index_++);
    channels[TOOL_X] = step.displacement[0];
    channels[TOOL_Y] = step.displacement[1];
    acceleration = step.acceleration;
  } else {
    integrateTip(input, out);
    if (probe_) acceleration = tip_.acceleration(*probe_);
    if (recorded_ && !tip_prescribed_)
      recorded_->steps.push_back({out.force, {{channels[TOOL_X], channels[TOOL_Y]}}, acceleration});
  }
  if (!probe_) return;
  channels[DISPLACEMENT] = channels[TOOL_X + *probe_];
  channels[ACCELERATION] = acceleration;
}

void CuttingMachine::integrateTip(const Input& input, Output& out) {
  std::array<double, 2> at{};
  if (vibrates()) {
    const double jump = contact_.jump();
    const std::array<double, 2> force{{out.force.fx + input.tip_force[0], out.force.fy + input.tip_force[1]}};
    const std::array<double, 2> before{
        {force[0] - jump * (out.force.fx - last_.fx), force[1] - jump * (out.force.fy - last_.fy)}};
    // A jump is not extrapolated.
    at = tip_.step(before, force, jump != 0.0, !contact_.changed());
    out.raw[TOOL_X] = at[0];
    out.raw[TOOL_Y] = at[1];
  }
  if (!cutter_) return;
  if (input.tip) at = input.tip->displacement;
  cutter_->endStep(at);
  layers_.endStep(at);
}

void CuttingMachine::endStep(const CuttingForce& force) {
  last_ = force;
  contact_.endStep();
}

void CuttingMachine::advanceTime(const ToolMotion& motion, std::size_t steps) {
  const double time = static_cast<double>(steps) * time_step_;
  now_.record_time += time;
  if (clock_.record || cutting()) clock_.edge_time += time;
  if (!clock_.record) clock_.start_time += time;
  contact_.advance(time, motion, state_);
}

// Whether no effect changes the state from step to step or depends on the instant of a step.
bool CuttingMachine::replaysWithoutUpdates() const {
  return layers_.empty() && !probe_ &&
         !(effects_.has(Stage::motion) || effects_.has(Stage::cutting_law) || effects_.has(Stage::sensor) ||
           effects_.has(Stage::sensor_force) || effects_.has(Stage::drive) ||
           effects_.has(Stage::sensor_output));
}

// Replays the remaining steps of a continuing cut.
void CuttingMachine::replayRest(std::size_t from, const ChannelRows& raw, History& history) {
  std::vector<double>* const x = raw[TOOL_X];
  std::vector<double>* const y = raw[TOOL_Y];
  const std::size_t steps = history.force.size();
  if (replaysTrace()) {
    for (std::size_t k = from; k < steps; ++k) {
      const CutTrace::Step& step = replayed_->steps.at(replay_index_++);
      history.force[k] = step.force;
      if (x) (*x)[k] = step.displacement[0];
      if (y) (*y)[k] = step.displacement[1];
    }
  } else {
    const Input input;
    Output out;
    for (std::size_t k = from; k < steps; ++k) {
      out.force = history.force[k] = cutter_->step(input.motion);
      if (!vibrates() || !(x || y)) continue;
      integrateTip(input, out);
      if (x) (*x)[k] = out.raw[TOOL_X];
      if (y) (*y)[k] = out.raw[TOOL_Y];
    }
  }
  last_ = history.force.back();
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
  history.before = last_;
  history.force.resize(steps);
  if (has_sensor_force) history.applied.resize(steps);
  if (has_output_effects) history.instants.resize(steps);
  if (recorded_) (tracesSums() ? recorded_->sums.reserve(steps) : recorded_->steps.reserve(steps));
  Input input;
  Output out;
  const bool replays_rest = replayed_ && replaysWithoutUpdates();
  for (std::size_t k = 0; k < steps; ++k) {
    if (replays_rest && cutting() && contact_.jump() == 0.0) {
      replayRest(k, raw, history);
      next(steps - 1, input);
      now_.angle = input.motion.angle;
      advanceTime(input.motion, steps - k);
      return;
    }
    next(k, input);
    applyEffects(input);
    if (has_output_effects) history.instants[k] = now_;
    out.force = history.force[k] = cuttingForce(input);
    if (has_sensor_force) {
      history.applied[k] = {{out.force.fx, out.force.fy, out.force.fz}};
      effects_.addForce(now_, history.applied[k]);
    }
    updateTip(input, out);
    for (const std::size_t c : {TOOL_X, TOOL_Y}) {
      if (raw[c]) (*raw[c])[k] = out.raw[c];
    }
    if (contact_.jump() != 0.0) history.jumps.emplace_back(k, contact_.jump());
    endStep(out.force);
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
