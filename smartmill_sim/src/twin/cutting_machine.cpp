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
      sign_(model.force_sensor.measures_workpiece ? -1.0 : 1.0) {
  TwinSetup setup = setUpOf(std::move(model_), effects_);
  model_ = std::move(setup.model);

  const double rate = 1.0 / time_step;
  vibrates_ = !model_.tool_tip.x.modes.empty() || !model_.tool_tip.y.modes.empty();
  if (model_.tool) nominal_.radius = model_.tool->radius();
  if (model_.tool && model_.cutting) {
    nominal_.law.coefficients = model_.needCutting("simulate a cut");
    const bool tables = feed == Feed::steady && !vibrates_;
    cutter_.emplace(*model_.tool, nominal_.law, time_step, setup.radius_offset, setup.corner_radius,
                    setup.path_share, tables ? Cutter::Way::tables : Cutter::Way::history, corner_slices);
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

ToolMotion CuttingMachine::fed(const ToolMotion& commanded) const {
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
  engaged_ = arcs_.empty() != arcs.empty();
  jump_ = 1.0 - rise;
  arcs_ = arcs;
  std::vector<ContactArc> actual = arcs;
  for (ContactArc& a : actual) a.depth = actualDepth(a.depth);
  depth_extra_ = state_.depth_extra;
  if (replayed()) return;
  cutter_->engage(actual, fed(now));
  layers_.engage(actual, fed(now));
}

double CuttingMachine::actualDepth(double commanded) const {
  const double error = state_.depth_extra + state_.depth_slope * feed_path_;
  return error == 0.0 ? commanded : std::max(commanded + error, LEAST_DEPTH);
}

void CuttingMachine::setActualDepths() {
  std::vector<double> depths;
  for (const ContactArc& a : arcs_) depths.push_back(actualDepth(a.depth));
  depth_extra_ = state_.depth_extra;
  if (!cutter_ || replayed()) return;
  cutter_->setDepths(depths);
  layers_.setDepths(depths);
}

void CuttingMachine::setDepth(double depth, double passed_over) {
  for (ContactArc& a : arcs_) a.depth = depth;
  feed_path_ += passed_over;
  setActualDepths();
}

void CuttingMachine::showOnly(const std::vector<std::size_t>& channels) {
  const auto asked = [&](std::size_t channel) {
    return std::find(channels.begin(), channels.end(), channel) != channels.end();
  };
  shows_force_ = {{asked(FX), asked(FY), asked(FZ)}};
  shows_load_ = asked(LOAD_METER);
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
  takeOver(input);
  out.force = cut(input);
  out.applied = {{out.force.fx + input.sensor_force[0], out.force.fy + input.sensor_force[1],
                  out.force.fz + input.sensor_force[2]}};
  if (effects_.has(Stage::sensor_force)) effects_.addForce(now_, out.applied);
  moveTip(input, out);
  showForce(out);
  showLoad(input.motion.speed, out);
  jump_ = 0.0;
  engaged_ = false;
  if (effects_.has(Stage::sensor_output)) effects_.measure(Stage::sensor_output, now_, out.early);
  passOn(out);
  ChannelValues shown = out.early;
  if (effects_.has(Stage::signal)) effects_.measure(Stage::signal, now_, shown);
  out.sensor = {{shown[FX], shown[FY], shown[FZ]}};
  out.load_meter = shown[LOAD_METER];
  out.displacement = {{shown[TOOL_X], shown[TOOL_Y]}};
  passTime(input.motion);
}

void CuttingMachine::takeOver(const Input& input) {
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
  if (feed[0] != chip_of_[0] || feed[1] != chip_of_[1] || now_.speed != chip_of_[2]) {
    chip_of_ = {{feed[0], feed[1], now_.speed}};
    chip_ = std::hypot(feed[0], feed[1]) * units::TWO_PI / (std::abs(now_.speed) * model_.tool->teeth);
  }
  now_.chip = chip_;
  now_.depth = arcs_.front().depth;
}

CuttingForce CuttingMachine::cut(const Input& input) {
  if (replayed()) return followed_->steps.at(place_).force;
  if (!cutter_) return {};
  if (rigid() && state_.feed_ratio == 1.0) {
    CuttingForce force = cutter_->step(input.motion);
    layers_.add(input.motion, force);
    return force;
  }
  ToolMotion motion = fed(input.motion);
  if (input.tip) {
    motion.displacement = input.tip->displacement;
    motion.rate = input.tip->rate;
  }
  // The displacement of the tip depends on the force of this step and vice versa: the force is first
  // extrapolated linearly, with an error of second order in the step.
  TipYield yield;
  for (std::size_t axis = 0; axis < 2 && vibrates_ && !input.tip; ++axis) {
    const std::array<double, 2>& f = tip_history_[axis];
    const double force = 2.0 * f[0] - f[1];
    motion.displacement[axis] = tip_[axis].peek(force);
    if (state_.law.damping == 0.0) continue;
    motion.rate[axis] = tip_[axis].peekRate(force);
    yield.rate[axis] = tip_[axis].rateOfInput();
    yield.assumed[axis] = force - input.tip_force[axis];
  }
  CuttingForce layers;
  layers_.add(motion, layers);
  yield.assumed[0] -= layers.fx;
  yield.assumed[1] -= layers.fy;
  layers.add(cutter_->step(motion, yield));
  return layers;
}

void CuttingMachine::moveTip(const Input& input, Output& out) {
  if (rigid()) return;
  ChannelValues& channels = out.early;
  double acceleration = 0.0;
  if (replayed()) {
    const CutTrace::Step& step = followed_->steps.at(place_++);
    channels[TOOL_X] = step.displacement[0];
    channels[TOOL_Y] = step.displacement[1];
    acceleration = step.acceleration;
  } else {
    settleTip(input, out);
    if (probe_) acceleration = tip_[*probe_].acceleration();
    if (kept_ && !guided_)
      kept_->steps.push_back({out.force, {{channels[TOOL_X], channels[TOOL_Y]}}, acceleration});
  }
  if (!probe_) return;
  channels[DISPLACEMENT] = channels[TOOL_X + *probe_];
  channels[ACCELERATION] = acceleration;
}

void CuttingMachine::settleTip(const Input& input, Output& out) {
  const std::array<double, 2> tip{{out.force.fx + input.tip_force[0], out.force.fy + input.tip_force[1]}};
  ChannelValues& channels = out.early;
  for (std::size_t axis = 0; axis < 2 && vibrates_; ++axis) {
    const double before = tip[axis] - jump_ * ((axis == 0 ? out.force.fx : out.force.fy) - last_cut_[axis]);
    channels[TOOL_X + axis] = jump_ != 0.0 ? tip_[axis].jump(before, tip[axis]) : tip_[axis].step(before);
    // A jump is not extrapolated.
    tip_history_[axis] = {{tip[axis], engaged_ ? tip[axis] : tip_history_[axis][0]}};
  }
  if (!cutter_) return;
  std::array<double, 2> at{};
  if (input.tip) {
    at = input.tip->displacement;
  } else if (vibrates_) {
    at = {{channels[TOOL_X], channels[TOOL_Y]}};
  }
  cutter_->settle(at);
  layers_.settle(at);
}

void CuttingMachine::showForce(Output& out) {
  const std::array<double, 3> cut{{out.force.fx, out.force.fy, out.force.fz}};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!shows_force_[axis]) continue;
    const double before = out.applied[axis] - jump_ * (cut[axis] - last_cut_[axis]);
    out.early[FX + axis] =
        sign_ * (jump_ != 0.0 ? sensor_[axis].jump(before, out.applied[axis]) : sensor_[axis].step(before));
  }
  last_cut_ = cut;
}

void CuttingMachine::showLoad(double speed, Output& out) {
  out.early[LOAD_METER] = 0.0;
  if (!drive_ || !shows_load_) return;
  const double mean_torque = last_torque_ + 0.5 * (1.0 - jump_) * (out.force.torque - last_torque_);
  out.early[LOAD_METER] = drive_->step(mean_torque, speed);
  last_torque_ = out.force.torque;
}

void CuttingMachine::passOn(Output& out) {
  if (!resonances_.empty()) {
    const ChannelValues before = out.early;
    for (auto& [resonance, filter] : resonances_)
      out.early[resonance.channel] += resonated(resonance, filter, before[resonance.from]);
  }
  for (auto& [channel, shelf] : shelves_) out.early[channel] = shelf.step(out.early[channel]);
  for (auto& [channel, line] : delays_) out.early[channel] = line.step(out.early[channel]);
}

void CuttingMachine::passTime(const ToolMotion& motion, std::size_t steps) {
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
bool CuttingMachine::stepsAlike() const {
  return layers_.empty() && !probe_ &&
         !(effects_.has(Stage::motion) || effects_.has(Stage::cutting_law) || effects_.has(Stage::sensor) ||
           effects_.has(Stage::sensor_force) || effects_.has(Stage::drive) ||
           effects_.has(Stage::sensor_output));
}

// Replays the remaining steps of a continuing cut.
void CuttingMachine::replay(std::size_t from, const EarlyRows& early, Course& course) {
  std::vector<double>* const x = early[TOOL_X];
  std::vector<double>* const y = early[TOOL_Y];
  const std::size_t steps = course.force.size();
  if (replayed()) {
    for (std::size_t k = from; k < steps; ++k) {
      const CutTrace::Step& step = followed_->steps.at(place_++);
      course.force[k] = step.force;
      if (x) (*x)[k] = step.displacement[0];
      if (y) (*y)[k] = step.displacement[1];
    }
  } else {
    const Input input;
    Output out;
    for (std::size_t k = from; k < steps; ++k) {
      out.force = course.force[k] = cutter_->step(input.motion);
      if (!vibrates_ || !(x || y)) continue;
      settleTip(input, out);
      if (x) (*x)[k] = out.early[TOOL_X];
      if (y) (*y)[k] = out.early[TOOL_Y];
    }
  }
  const CuttingForce& last = course.force.back();
  last_cut_ = {{last.fx, last.fy, last.fz}};
}

void CuttingMachine::run(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                         const EarlyRows& early) {
  // Channels that are not requested may act on requested ones.
  const bool mixes = effects_.has(Stage::sensor_output) || !resonances_.empty();
  std::array<std::vector<double>, LOAD_METER + 1> own;
  EarlyRows rows = early;
  for (std::size_t c = 0; c < own.size() && mixes; ++c) {
    if (rows[c]) continue;
    own[c].resize(steps);
    rows[c] = &own[c];
  }
  Course course;
  cutAll(steps, next, rows, course);
  showAll(course, rows);
  if (effects_.has(Stage::sensor_output)) measureAll(course, rows);
  passAllOn(steps, rows);
}

void CuttingMachine::cutAll(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                            const EarlyRows& early, Course& course) {
  const bool pushed = effects_.has(Stage::sensor_force), measured = effects_.has(Stage::sensor_output);
  course.before = last_cut_;
  course.force.resize(steps);
  if (pushed) course.applied.resize(steps);
  if (measured) course.instants.resize(steps);
  if (kept_) (keepsSums() ? kept_->sums.reserve(steps) : kept_->steps.reserve(steps));
  Input input;
  Output out;
  const bool alike = followed_ && stepsAlike();
  for (std::size_t k = 0; k < steps; ++k) {
    if (alike && cutting() && jump_ == 0.0) {
      replay(k, early, course);
      next(steps - 1, input);
      now_.angle = input.motion.angle;
      passTime(input.motion, steps - k);
      return;
    }
    next(k, input);
    takeOver(input);
    if (measured) course.instants[k] = now_;
    out.force = course.force[k] = cut(input);
    if (pushed) {
      course.applied[k] = {{out.force.fx, out.force.fy, out.force.fz}};
      effects_.addForce(now_, course.applied[k]);
    }
    moveTip(input, out);
    for (const std::size_t c : {TOOL_X, TOOL_Y}) {
      if (early[c]) (*early[c])[k] = out.early[c];
    }
    last_cut_ = {{out.force.fx, out.force.fy, out.force.fz}};
    if (jump_ != 0.0) course.jumps.emplace_back(k, jump_);
    jump_ = 0.0;
    engaged_ = false;
    passTime(input.motion);
  }
}

// The filters are independent of each other and run in parallel on one core (instruction-level parallelism).
void CuttingMachine::showAll(const Course& course, const EarlyRows& early) {
  struct Shown {
    std::size_t axis;
    double CuttingForce::*of;
    double* row;
  };
  constexpr std::array<double CuttingForce::*, 3> OF_AXIS{
      {&CuttingForce::fx, &CuttingForce::fy, &CuttingForce::fz}};
  std::vector<Shown> forces;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (shows_force_[axis] && early[FX + axis])
      forces.push_back({axis, OF_AXIS[axis], early[FX + axis]->data()});
  }
  double* const load = drive_ && shows_load_ && early[LOAD_METER] ? early[LOAD_METER]->data() : nullptr;
  auto jump = course.jumps.begin();
  CuttingForce last{course.before[0], course.before[1], course.before[2]};
  for (std::size_t k = 0; k < course.force.size(); ++k) {
    const CuttingForce& now = course.force[k];
    const double jumps = jump != course.jumps.end() && jump->first == k ? (jump++)->second : 0.0;
    for (const Shown& s : forces) {
      const double cut = now.*s.of, applied = course.applied.empty() ? cut : course.applied[k][s.axis];
      ModalFilter& sensor = sensor_[s.axis];
      s.row[k] = sign_ * (jumps == 0.0 ? sensor.step(applied)
                                       : sensor.jump(applied - jumps * (cut - last.*s.of), applied));
    }
    if (load) {
      load[k] = drive_->step(last_torque_ + 0.5 * (1.0 - jumps) * (now.torque - last_torque_), now_.speed);
      last_torque_ = now.torque;
    }
    last = now;
  }
}

void CuttingMachine::measureAll(const Course& course, const EarlyRows& early) const {
  for (std::size_t k = 0; k < course.instants.size(); ++k) {
    ChannelValues values{};
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (early[c]) values[c] = (*early[c])[k];
    }
    effects_.measure(Stage::sensor_output, course.instants[k], values);
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (early[c]) (*early[c])[k] = values[c];
    }
  }
}

void CuttingMachine::passAllOn(std::size_t steps, const EarlyRows& early) {
  for (std::size_t k = 0; k < steps && !resonances_.empty(); ++k) {
    ChannelValues before{};
    for (const auto& [resonance, filter] : resonances_) before[resonance.from] = (*early[resonance.from])[k];
    for (auto& [resonance, filter] : resonances_)
      (*early[resonance.channel])[k] += resonated(resonance, filter, before[resonance.from]);
  }
  for (auto& [channel, shelf] : shelves_) {
    if (!early[channel]) continue;
    for (double& v : *early[channel]) v = shelf.step(v);
  }
  for (auto& [channel, line] : delays_) {
    if (!early[channel]) continue;
    for (double& v : *early[channel]) v = line.step(v);
  }
}

void CuttingMachine::finish(double record_time, ChannelValues& channels) const {
  Instant at = now_;
  at.record_time = record_time;
  effects_.measure(Stage::signal, at, channels);
}

}  // namespace smartmill::sim
