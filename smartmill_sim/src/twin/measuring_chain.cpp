#include "smartmill_sim/twin/measuring_chain.h"

#include <algorithm>
#include <cmath>

namespace smartmill::sim {
namespace {

constexpr std::array<double CuttingForce::*, 3> OF_AXIS{
    {&CuttingForce::fx, &CuttingForce::fy, &CuttingForce::fz}};

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

MeasuringChain::MeasuringChain(const TwinSetup& setup, double time_step, double sensor_tolerance)
    : sensor_tolerance_(sensor_tolerance),
      model_(setup.model.force_sensor.axis),
      rate_(1.0 / time_step),
      force_sign_(setup.model.force_sensor.measures_workpiece ? -1.0 : 1.0) {
  for (const ModalModel& axis : model_) sensor_.emplace_back(axis, rate_, Hold::first_order);
  if (setup.model.spindle) drive_.emplace(*setup.model.spindle, time_step);
  for (const Resonance& resonance : setup.resonances) {
    ModalModel path;
    path.modes = {resonance.mode};
    resonances_.emplace_back(resonance, ModalFilter(path, rate_, Hold::first_order));
  }
  for (const auto& [channel, shelf] : setup.shelves)
    shelves_.emplace_back(channel, ShelfFilter(shelf, time_step));
  for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
    if (setup.delay[c] > 0.0) delays_.emplace_back(c, DelayLine(setup.delay[c], time_step, 0.0));
  }
}

void MeasuringChain::update(const TwinState& state) {
  if (drive_) drive_->setFriction(state.friction_extra, state.friction_factor);
  // The first update is exact, later ones follow the tolerance.
  const double moved = std::abs(state.sensor_frequency / sensor_frequency_ - 1.0);
  if (!(moved > sensor_tolerance_ || (sensor_frequency_ == 1.0 && moved > 0.0))) return;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    ModalFilter next(firstModeAt(model_[axis], state.sensor_frequency), rate_, Hold::first_order);
    next.continueFrom(sensor_[axis]);
    sensor_[axis] = std::move(next);
  }
  sensor_frequency_ = state.sensor_frequency;
}

void MeasuringChain::select(const std::vector<std::size_t>& channels) {
  const auto selected = [&](std::size_t channel) {
    return std::find(channels.begin(), channels.end(), channel) != channels.end();
  };
  force_selected_ = {{selected(FX), selected(FY), selected(FZ)}};
  load_selected_ = selected(LOAD_METER);
}

double MeasuringChain::resetLoad(double spindle_speed) {
  if (!drive_) return 0.0;
  drive_->reset(spindle_speed);
  return drive_->steady(spindle_speed);
}

void MeasuringChain::resetDelay(std::size_t channel, double value) {
  for (auto& [delayed, line] : delays_) {
    if (delayed == channel) line.reset(value);
  }
}

void MeasuringChain::measure(const CuttingForce& before, const CuttingForce& now, double jump,
                             const std::array<double, 3>& applied, double speed, ChannelValues& channels) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!force_selected_[axis]) continue;
    const double at = applied[axis] - jump * (now.*OF_AXIS[axis] - before.*OF_AXIS[axis]);
    channels[FX + axis] =
        force_sign_ * (jump != 0.0 ? sensor_[axis].jump(at, applied[axis]) : sensor_[axis].step(at));
  }
  channels[LOAD_METER] = 0.0;
  if (drive_ && load_selected_)
    channels[LOAD_METER] =
        drive_->step(before.torque + 0.5 * (1.0 - jump) * (now.torque - before.torque), speed);
}

void MeasuringChain::filter(ChannelValues& channels) {
  if (!resonances_.empty()) {
    const ChannelValues before = channels;
    for (auto& [resonance, filter] : resonances_)
      channels[resonance.channel] += resonated(resonance, filter, before[resonance.from]);
  }
  for (auto& [channel, shelf] : shelves_) channels[channel] = shelf.step(channels[channel]);
  for (auto& [channel, line] : delays_) channels[channel] = line.step(channels[channel]);
}

// The filters are independent of each other and run in parallel on one core (instruction-level parallelism).
void MeasuringChain::measure(const ForceHistory& history, double speed, const ChannelRows& rows) {
  struct ForceRow {
    std::size_t axis;
    double CuttingForce::*of;
    double* row;
  };
  std::vector<ForceRow> forces;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (force_selected_[axis] && rows[FX + axis])
      forces.push_back({axis, OF_AXIS[axis], rows[FX + axis]->data()});
  }
  double* const load = drive_ && load_selected_ && rows[LOAD_METER] ? rows[LOAD_METER]->data() : nullptr;
  auto jump = history.jumps.begin();
  CuttingForce last = history.before;
  for (std::size_t k = 0; k < history.force.size(); ++k) {
    const CuttingForce& now = history.force[k];
    const double jumps = jump != history.jumps.end() && jump->first == k ? (jump++)->second : 0.0;
    for (const ForceRow& s : forces) {
      const double cut = now.*s.of, applied = history.applied.empty() ? cut : history.applied[k][s.axis];
      ModalFilter& sensor = sensor_[s.axis];
      s.row[k] = force_sign_ * (jumps == 0.0 ? sensor.step(applied)
                                             : sensor.jump(applied - jumps * (cut - last.*s.of), applied));
    }
    if (load) load[k] = drive_->step(last.torque + 0.5 * (1.0 - jumps) * (now.torque - last.torque), speed);
    last = now;
  }
}

void MeasuringChain::filter(std::size_t steps, const ChannelRows& rows) {
  for (std::size_t k = 0; k < steps && !resonances_.empty(); ++k) {
    ChannelValues before{};
    for (const auto& [resonance, filter] : resonances_) before[resonance.from] = (*rows[resonance.from])[k];
    for (auto& [resonance, filter] : resonances_)
      (*rows[resonance.channel])[k] += resonated(resonance, filter, before[resonance.from]);
  }
  for (auto& [channel, shelf] : shelves_) {
    if (!rows[channel]) continue;
    for (double& v : *rows[channel]) v = shelf.step(v);
  }
  for (auto& [channel, line] : delays_) {
    if (!rows[channel]) continue;
    for (double& v : *rows[channel]) v = line.step(v);
  }
}

}  // namespace smartmill::sim
