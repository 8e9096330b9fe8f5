#include "smartmill_sim/twin/cutting_machine.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr int UPDATE_STEPS = 16;           // between updates of slow changes
constexpr double SENSOR_TOLERANCE = 1e-5;  // relative change of a sensor mode that updates its filter
constexpr double LEAST_DEPTH = 1e-9;       // [m] instead of a depth <= 0

ModalModel firstModeAt(ModalModel axis, double factor) {
  if (!axis.modes.empty()) axis.modes.front().frequency *= factor;
  return axis;
}

// Output that a resonance adds to its channel.
double resonated(const Resonance& resonance, ModalFilter& filter, double from) {
  const double itself = resonance.channel == resonance.from ? resonance.mode.gain * from : 0.0;
  return filter.step(from) - itself;
}

}  // namespace

CuttingMachine::CuttingMachine(const MachineModel& model, double time_step, Feed feed, int corner_slices)
    : effects_(model),
      model_(model),
      time_step_(time_step),
      force_sign_(model.force_sensor.measures_workpiece ? -1.0 : 1.0) {
  TwinSetup setup = setUpOf(std::move(model_), effects_);
  model_ = std::move(setup.model);

  const double rate = 1.0 / time_step;
  vibrates_ = !model_.tool_tip.x.modes.empty() || !model_.tool_tip.y.modes.empty();
  if (model_.tool) nominal_.radius = model_.tool->radius();
  if (model_.tool && model_.cutting) {
    nominal_.law.coefficients = model_.needCutting("simulate a cut");
    const bool tables = feed == Feed::steady && !vibrates_;
    cutter_.emplace(*model_.tool, nominal_.law, time_step, setup.radius_offset, setup.corner_radius,
                    setup.path_share, tables ? Cutter::Method::tables : Cutter::Method::history,
                    corner_slices);
    layers_ = EdgeLayers(setup, nominal_.law, time_step, tables);
  }
  state_ = nominal_;
  tip_.emplace_back(model_.tool_tip.x, rate, Hold::first_order);
  tip_.emplace_back(model_.tool_tip.y, rate, Hold::first_order);
  for (const ModalModel& axis : model_.force_sensor.axis) {
    sensor_.emplace_back(axis, rate, Hold::first_order);
  }
  if (model_.spindle) drive_.emplace(*model_.spindle, time_step);
  for (const Resonance& resonance : setup.resonances) {
    ModalModel path;
    path.modes = {resonance.mode};
    resonances_.emplace_back(resonance, ModalFilter(path, rate, Hold::first_order));
  }
  for (const auto& [channel, shelf] : setup.shelves)
    shelves_.emplace_back(channel, ShelfFilter(shelf, time_step));
  for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
    if (setup.delay[c] > 0.0) delays_.emplace_back(c, DelayLine(setup.delay[c], time_step, 0.0));
  }
}

void CuttingMachine::setClock(const Clock& clock) {
  clock_ = clock;
  now_.record_time = 0.0;
  steps_to_update_ = 0;
}

ToolMotion CuttingMachine::actualMotion(const ToolMotion& commanded) const {
  ToolMotion actual = commanded;
  if (state_.feed_ratio == 1.0 || !feed_start_) return actual;
  for (std::size_t a = 0; a < 2; ++a) {
    const double start = (*feed_start_)[a];
    actual.centre[a] = start + state_.feed_ratio * (commanded.centre[a] - start);
    actual.velocity[a] *= state_.feed_ratio;
  }
  return actual;
}

void CuttingMachine::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise) {
  if (!cutter_) throw Error(model_.file + ": tool or cutting is missing (needed to simulate a cut)");
  if (!feed_start_) feed_start_ = now.centre;
  if (arcs_.empty()) cut_time_ = 0.0;
  Input input;
  input.motion = now;
  update(input);
  if (arcs_.empty()) feed_path_ = 0.0;
  // A contact that only shifts changes the force gradually.
  contact_changed_ = arcs_.empty() != arcs.empty();
  jump_ = 1.0 - rise;
  arcs_ = arcs;
  std::vector<ContactArc> actual = arcs;
  for (ContactArc& a : actual) a.depth = actualDepth(a.depth);
  depth_extra_ = state_.depth_extra;
  if (replaysTrace()) return;
  cutter_->engage(actual, actualMotion(now));
  layers_.engage(actual, actualMotion(now));
}

double CuttingMachine::actualDepth(double commanded) const {
  const double error = state_.depth_extra + state_.depth_slope * feed_path_;
  return error == 0.0 ? commanded : std::max(commanded + error, LEAST_DEPTH);
}

void CuttingMachine::setActualDepths() {
  std::vector<double> depths;
  for (const ContactArc& a : arcs_) depths.push_back(actualDepth(a.depth));
  depth_extra_ = state_.depth_extra;
  if (!cutter_ || replaysTrace()) return;
  cutter_->setDepths(depths);
  layers_.setDepths(depths);
}

void CuttingMachine::setDepth(double depth, double passed_over) {
  for (ContactArc& a : arcs_) a.depth = depth;
  feed_path_ += passed_over;
  setActualDepths();
}

void CuttingMachine::selectChannels(const std::vector<std::size_t>& channels) {
  const auto selected = [&](std::size_t channel) {
    return std::find(channels.begin(), channels.end(), channel) != channels.end();
  };
  force_selected_ = {{selected(FX), selected(FY), selected(FZ)}};
  load_selected_ = selected(LOAD_METER);
}

void CuttingMachine::resetLoadMeter(double spindle_speed) {
  if (!drive_) return;
  Input input;
  input.motion.speed = spindle_speed;
  update(input);
  drive_->reset(spindle_speed);
  for (auto& [channel, line] : delays_) {
    ChannelValues values{};
    values[LOAD_METER] = drive_->steady(spindle_speed);
    effects_.measure(Stage::sensor_output, now_, values);
    if (channel == LOAD_METER) line.reset(values[LOAD_METER]);
  }
}

void CuttingMachine::update(const Input& input) {
  now_.angle = input.motion.angle;
  now_.speed = input.motion.speed;
  now_.start_time = clock_.start_time;
  now_.edge_time = clock_.edge_time;
  now_.cut_time = cut_time_;
  state_ = nominal_;
  effects_.update(now_, state_);
  if (cutter_) cutter_->setLaw(state_.law);
  layers_.setLaw(state_.law);
  if (drive_) drive_->setFriction(state_.friction_extra, state_.friction_factor);
  // The first update is exact, later ones follow the tolerance.
  const double moved = std::abs(state_.sensor_frequency / sensor_frequency_ - 1.0);
  if (moved > SENSOR_TOLERANCE || (sensor_frequency_ == 1.0 && moved > 0.0)) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ModalFilter next(firstModeAt(model_.force_sensor.axis[axis], state_.sensor_frequency), 1.0 / time_step_,
                       Hold::first_order);
      next.continueFrom(sensor_[axis]);
      sensor_[axis] = std::move(next);
    }
    sensor_frequency_ = state_.sensor_frequency;
  }
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
  measureForce(out);
  measureLoad(input.motion.speed, out);
  jump_ = 0.0;
  contact_changed_ = false;
  if (effects_.has(Stage::sensor_output)) effects_.measure(Stage::sensor_output, now_, out.raw);
  filterChannels(out);
  ChannelValues measured = out.raw;
  if (effects_.has(Stage::signal)) effects_.measure(Stage::signal, now_, measured);
  out.sensor = {{measured[FX], measured[FY], measured[FZ]}};
  out.load_meter = measured[LOAD_METER];
  out.displacement = {{measured[TOOL_X], measured[TOOL_Y]}};
  advanceTime(input.motion);
}

void CuttingMachine::applyEffects(const Input& input) {
  if (!effects_.empty() && (steps_to_update_ <= 0 || input.motion.speed != now_.speed)) {
    update(input);
    steps_to_update_ = UPDATE_STEPS;
    const bool moved = state_.depth_slope != 0.0 || state_.depth_extra != depth_extra_;
    if (moved && cutting()) setActualDepths();
  }
  --steps_to_update_;
  now_.axis_acceleration = input.axis_acceleration;
  now_.angle = input.motion.angle;
  now_.speed = input.motion.speed;
  now_.chip = now_.depth = 0.0;
  if (!cutting() || now_.speed == 0.0) return;
  const std::array<double, 2>& feed = input.motion.velocity;
  if (feed[0] != chip_motion_[0] || feed[1] != chip_motion_[1] || now_.speed != chip_motion_[2]) {
    chip_motion_ = {{feed[0], feed[1], now_.speed}};
    chip_ = std::hypot(feed[0], feed[1]) * units::TWO_PI / (std::abs(now_.speed) * model_.tool->teeth);
  }
  now_.chip = chip_;
  now_.depth = arcs_.front().depth;
}

CuttingForce CuttingMachine::cuttingForce(const Input& input) {
  if (replaysTrace()) return replayed_->steps.at(replay_index_).force;
  if (!cutter_) return {};
  if (rigid() && state_.feed_ratio == 1.0) {
    CuttingForce force = cutter_->step(input.motion);
    layers_.add(input.motion, force);
    return force;
  }
  ToolMotion motion = actualMotion(input.motion);
  if (input.tip) {
    motion.displacement = input.tip->displacement;
    motion.rate = input.tip->rate;
  }
  // The displacement of the tip depends on the force of this step and vice versa: the force is first
  // extrapolated linearly, with an error of second order in the step.
  TipMobility mobility;
  for (std::size_t axis = 0; axis < 2 && vibrates_ && !input.tip; ++axis) {
    const std::array<double, 2>& f = tip_history_[axis];
    const double force = 2.0 * f[0] - f[1];
    motion.displacement[axis] = tip_[axis].peek(force);
    if (state_.law.damping == 0.0) continue;
    motion.rate[axis] = tip_[axis].peekRate(force);
    mobility.rate_per_force[axis] = tip_[axis].rateOfInput();
    mobility.assumed_force[axis] = force - input.tip_force[axis];
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
    if (probe_) acceleration = tip_[*probe_].acceleration();
    if (recorded_ && !tip_prescribed_)
      recorded_->steps.push_back({out.force, {{channels[TOOL_X], channels[TOOL_Y]}}, acceleration});
  }
  if (!probe_) return;
  channels[DISPLACEMENT] = channels[TOOL_X + *probe_];
  channels[ACCELERATION] = acceleration;
}

void CuttingMachine::integrateTip(const Input& input, Output& out) {
  const std::array<double, 2> tip{{out.force.fx + input.tip_force[0], out.force.fy + input.tip_force[1]}};
  ChannelValues& channels = out.raw;
  for (std::size_t axis = 0; axis < 2 && vibrates_; ++axis) {
    const double before = tip[axis] - jump_ * ((axis == 0 ? out.force.fx : out.force.fy) - last_cut_[axis]);
    channels[TOOL_X + axis] = jump_ != 0.0 ? tip_[axis].jump(before, tip[axis]) : tip_[axis].step(before);
    // A jump is not extrapolated.
    tip_history_[axis] = {{tip[axis], contact_changed_ ? tip[axis] : tip_history_[axis][0]}};
  }
  if (!cutter_) return;
  std::array<double, 2> at{};
  if (input.tip) {
    at = input.tip->displacement;
  } else if (vibrates_) {
    at = {{channels[TOOL_X], channels[TOOL_Y]}};
  }
  cutter_->endStep(at);
  layers_.endStep(at);
}

void CuttingMachine::measureForce(Output& out) {
  const std::array<double, 3> cut{{out.force.fx, out.force.fy, out.force.fz}};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!force_selected_[axis]) continue;
    const double before = out.applied[axis] - jump_ * (cut[axis] - last_cut_[axis]);
    out.raw[FX + axis] = force_sign_ * (jump_ != 0.0 ? sensor_[axis].jump(before, out.applied[axis])
                                                     : sensor_[axis].step(before));
  }
  last_cut_ = cut;
}

void CuttingMachine::measureLoad(double speed, Output& out) {
  out.raw[LOAD_METER] = 0.0;
  if (!drive_ || !load_selected_) return;
  const double mean_torque = last_torque_ + 0.5 * (1.0 - jump_) * (out.force.torque - last_torque_);
  out.raw[LOAD_METER] = drive_->step(mean_torque, speed);
  last_torque_ = out.force.torque;
}

void CuttingMachine::filterChannels(Output& out) {
  if (!resonances_.empty()) {
    const ChannelValues before = out.raw;
    for (auto& [resonance, filter] : resonances_)
      out.raw[resonance.channel] += resonated(resonance, filter, before[resonance.from]);
  }
  for (auto& [channel, shelf] : shelves_) out.raw[channel] = shelf.step(out.raw[channel]);
  for (auto& [channel, line] : delays_) out.raw[channel] = line.step(out.raw[channel]);
}

void CuttingMachine::advanceTime(const ToolMotion& motion, std::size_t steps) {
  const double time = static_cast<double>(steps) * time_step_;
  now_.record_time += time;
  if (clock_.record || cutting()) clock_.edge_time += time;
  if (cutting()) cut_time_ += time;
  if (!clock_.record) clock_.start_time += time;
  if (state_.depth_slope != 0.0 && cutting()) {
    const std::array<double, 2>& v = motion.velocity;
    feed_path_ += time * state_.feed_ratio * std::hypot(v[0], v[1]);
  }
}

// Whether no effect changes the state from step to step or depends on the instant of a step.
bool CuttingMachine::replaysWithoutUpdates() const {
  return layers_.empty() && !probe_ &&
         !(effects_.has(Stage::motion) || effects_.has(Stage::cutting_law) || effects_.has(Stage::sensor) ||
           effects_.has(Stage::sensor_force) || effects_.has(Stage::drive) ||
           effects_.has(Stage::sensor_output));
}

// Replays the remaining steps of a continuing cut.
void CuttingMachine::replayRest(std::size_t from, const ChannelRows& raw, StepHistory& history) {
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
      if (!vibrates_ || !(x || y)) continue;
      integrateTip(input, out);
      if (x) (*x)[k] = out.raw[TOOL_X];
      if (y) (*y)[k] = out.raw[TOOL_Y];
    }
  }
  const CuttingForce& last = history.force.back();
  last_cut_ = {{last.fx, last.fy, last.fz}};
}

void CuttingMachine::run(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                         const ChannelRows& raw) {
  // Channels that are not requested may act on requested ones.
  const bool mixes = effects_.has(Stage::sensor_output) || !resonances_.empty();
  std::array<std::vector<double>, LOAD_METER + 1> unrequested;
  ChannelRows rows = raw;
  for (std::size_t c = 0; c < unrequested.size() && mixes; ++c) {
    if (rows[c]) continue;
    unrequested[c].resize(steps);
    rows[c] = &unrequested[c];
  }
  StepHistory history;
  simulateCut(steps, next, rows, history);
  measureSensors(history, rows);
  if (effects_.has(Stage::sensor_output)) applyOutputEffects(history, rows);
  filterRows(steps, rows);
}

void CuttingMachine::simulateCut(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                                 const ChannelRows& raw, StepHistory& history) {
  const bool has_sensor_force = effects_.has(Stage::sensor_force),
             has_output_effects = effects_.has(Stage::sensor_output);
  history.before = last_cut_;
  history.force.resize(steps);
  if (has_sensor_force) history.applied.resize(steps);
  if (has_output_effects) history.instants.resize(steps);
  if (recorded_) (tracesSums() ? recorded_->sums.reserve(steps) : recorded_->steps.reserve(steps));
  Input input;
  Output out;
  const bool replays_rest = replayed_ && replaysWithoutUpdates();
  for (std::size_t k = 0; k < steps; ++k) {
    if (replays_rest && cutting() && jump_ == 0.0) {
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
    last_cut_ = {{out.force.fx, out.force.fy, out.force.fz}};
    if (jump_ != 0.0) history.jumps.emplace_back(k, jump_);
    jump_ = 0.0;
    contact_changed_ = false;
    advanceTime(input.motion);
  }
}

// The filters are independent of each other and run in parallel on one core (instruction-level parallelism).
void CuttingMachine::measureSensors(const StepHistory& history, const ChannelRows& raw) {
  struct ForceRow {
    std::size_t axis;
    double CuttingForce::*of;
    double* row;
  };
  constexpr std::array<double CuttingForce::*, 3> OF_AXIS{
      {&CuttingForce::fx, &CuttingForce::fy, &CuttingForce::fz}};
  std::vector<ForceRow> forces;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (force_selected_[axis] && raw[FX + axis])
      forces.push_back({axis, OF_AXIS[axis], raw[FX + axis]->data()});
  }
  double* const load = drive_ && load_selected_ && raw[LOAD_METER] ? raw[LOAD_METER]->data() : nullptr;
  auto jump = history.jumps.begin();
  CuttingForce last{history.before[0], history.before[1], history.before[2]};
  for (std::size_t k = 0; k < history.force.size(); ++k) {
    const CuttingForce& now = history.force[k];
    const double jumps = jump != history.jumps.end() && jump->first == k ? (jump++)->second : 0.0;
    for (const ForceRow& s : forces) {
      const double cut = now.*s.of, applied = history.applied.empty() ? cut : history.applied[k][s.axis];
      ModalFilter& sensor = sensor_[s.axis];
      s.row[k] = force_sign_ * (jumps == 0.0 ? sensor.step(applied)
                                             : sensor.jump(applied - jumps * (cut - last.*s.of), applied));
    }
    if (load) {
      load[k] = drive_->step(last_torque_ + 0.5 * (1.0 - jumps) * (now.torque - last_torque_), now_.speed);
      last_torque_ = now.torque;
    }
    last = now;
  }
}

void CuttingMachine::applyOutputEffects(const StepHistory& history, const ChannelRows& raw) const {
  for (std::size_t k = 0; k < history.instants.size(); ++k) {
    ChannelValues values{};
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (raw[c]) values[c] = (*raw[c])[k];
    }
    effects_.measure(Stage::sensor_output, history.instants[k], values);
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (raw[c]) (*raw[c])[k] = values[c];
    }
  }
}

void CuttingMachine::filterRows(std::size_t steps, const ChannelRows& raw) {
  for (std::size_t k = 0; k < steps && !resonances_.empty(); ++k) {
    ChannelValues before{};
    for (const auto& [resonance, filter] : resonances_) before[resonance.from] = (*raw[resonance.from])[k];
    for (auto& [resonance, filter] : resonances_)
      (*raw[resonance.channel])[k] += resonated(resonance, filter, before[resonance.from]);
  }
  for (auto& [channel, shelf] : shelves_) {
    if (!raw[channel]) continue;
    for (double& v : *raw[channel]) v = shelf.step(v);
  }
  for (auto& [channel, line] : delays_) {
    if (!raw[channel]) continue;
    for (double& v : *raw[channel]) v = line.step(v);
  }
}

void CuttingMachine::applySignalEffects(double record_time, ChannelValues& channels) const {
  Instant at = now_;
  at.record_time = record_time;
  effects_.measure(Stage::signal, at, channels);
}

}  // namespace smartmill::sim
