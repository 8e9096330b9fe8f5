#include "hammer/station_machine.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

constexpr double RATE = 25600.0;        // [Hz]
constexpr std::size_t BLOCK = 256;      // samples
constexpr int STEPS = 8;                // per sample; the first-order hold is then 0.1 % low at 4 kHz
constexpr double LATENCY = 0.05;        // [s]
constexpr double RAPID = 0.4;           // [m/s]
constexpr double TURNING = 12.0;        // [rad/s] of an orientation
constexpr double HAMMER_DELAY = 0.03;   // [s]
constexpr double LONGEST = 1200.0;      // [s] of a measurement
constexpr double FIT_HIGH = 8000.0;     // [Hz] a mode above the scored band affects its upper end
constexpr double HEIGHT_STEP = 0.5e-3;  // [m] resolution of the stated sensor height

double stamp(double time) {
  return std::round(time * 1e9) * 1e-9;
}

}  // namespace

StationMachine::StationMachine(const DrawnStation& drawn, std::uint64_t seed)
    : drawn_(drawn),
      station_(drawn.true_model, drawn.traits, drawn.force_scatter, 1.0 / (RATE * STEPS)),
      random_(seed) {
}

void StationMachine::obey(const Command& c) {
  const double begin = time_ + LATENCY;
  switch (c.kind) {
    case Command::Kind::orient:
      orient_from_ = begin;
      orient_to_ = c.angle;
      orienting_ = true;
      search_moves_ += strikes_ == 0;
      break;
    case Command::Kind::jog: {
      Axes3 to = path_.empty() ? position_ : path_.back().position;
      to[*axisIndex(c.axis)] += c.distance;
      path_.push_back({to, c.feed});
      path_from_ = begin;
      break;
    }
    case Command::Kind::move:
      for (Waypoint w : c.path) {
        if (w.feed == 0.0) w.feed = RAPID;
        path_.push_back(w);
      }
      path_from_ = begin;
      break;
    case Command::Kind::strike: {
      const std::size_t axis = c.direction == "x" ? 0 : 1;
      const double share = std::uniform_real_distribution<double>(0.0, 1.0)(random_) / RATE;
      station_.fire(axis, time_, time_ + HAMMER_DELAY + share, random_);
      struck_ = std::max(
          struck_, station_.struckRetreat({position_, spindle_ + drawn_.mounting, spindle_speed_}, axis));
      ++strikes_;
      rest_volt_ = volt_;
      break;
    }
    case Command::Kind::stop:
      path_.clear();
      orienting_ = false;
      spindle_speed_ = 0.0;
      break;
  }
}

void StationMachine::moveOn(double dt) {
  if (orienting_ && time_ >= orient_from_) {
    const double rest = nearAngle(orient_to_, spindle_) - spindle_, most = TURNING * dt;
    if (std::abs(rest) <= most) {
      spindle_ = orient_to_;
      spindle_speed_ = 0.0;
      orienting_ = false;
    } else {
      spindle_ += std::copysign(most, rest);
      spindle_speed_ = TURNING;
    }
  }
  if (path_.empty() || time_ < path_from_) return;
  double way = path_.front().feed * dt;
  while (!path_.empty() && way > 0.0) {
    const Axes3& to = path_.front().position;
    double rest = 0.0;
    for (std::size_t i = 0; i < 3; ++i) rest = std::hypot(rest, to[i] - position_[i]);
    if (rest <= way) {
      position_ = to;
      way -= rest;
      path_.pop_front();
    } else {
      for (std::size_t i = 0; i < 3; ++i) position_[i] += (to[i] - position_[i]) * way / rest;
      way = 0.0;
    }
  }
}

void StationMachine::sample(Streams& streams) {
  moveOn(1.0 / RATE);
  station_.setPose({position_, spindle_ + drawn_.mounting, spindle_speed_}, random_);
  for (int s = 0; s < STEPS; ++s) {
    station_.push(time_ + ((s + 0.5) / STEPS - 0.5) / RATE);
    station_.addDisplacement({{0, 0}});
  }
  const sim::HammerStation::Sample reading = station_.read(time_, random_);
  volt_ = reading.gap;
  touched_ = touched_ || station_.touched();
  closest_ = std::min(closest_, station_.closest());
  streams.samples.samples.push_back(reading.force);
  streams.samples.samples.push_back(reading.gap);
  if (station_.hasCross()) streams.samples.samples.push_back(reading.cross);
  time_ += 1.0 / RATE;
}

void StationMachine::block(Streams& streams) {
  SampleBlock& b = streams.samples;
  b = SampleBlock();
  b.stamp = stamp(time_);
  b.sample_rate = RATE;
  b.first_index = index_;
  b.channels = {"hammer", "gap"};
  b.units = {"N", "V"};
  if (station_.hasCross()) {
    b.channels.emplace_back("gap_cross");
    b.units.emplace_back("V");
  }
  for (std::size_t i = 0; i < BLOCK; ++i) sample(streams);
  index_ += BLOCK;
  streams.angle = {stamp(time_), spindle_ - units::TWO_PI * std::floor(spindle_ / units::TWO_PI),
                   spindle_speed_};
  CncState& state = streams.state;
  state = CncState();
  state.stamp = streams.angle.stamp;
  state.connected = state.armed = true;
  state.mode = CncMode::dnc;
  state.motion = !path_.empty();
  state.axes = {"X", "Y", "Z"};
  for (std::size_t i = 0; i < 3; ++i) {
    state.position.push_back(std::round(position_[i] * 1e7) * 1e-7);
    state.distance_to_go.push_back(path_.empty() ? 0.0 : std::abs(path_.front().position[i] - position_[i]));
  }
}

MeasureFrfGoal goalOf(const DrawnStation& drawn, int hits) {
  MeasureFrfGoal goal;
  goal.stamp = 1000.0;
  goal.tool = "drawn";
  goal.point = POINT_TOOL_TIP;
  goal.direction = drawn.direction;
  goal.hits = hits;
  goal.teeth = drawn.believed.tool->teeth;
  return goal;
}

StationTask taskOf(const DrawnStation& drawn, int hits) {
  StationTask task;
  HammerParameters& p = task.parameters;
  p.frf_high = p.fit_high = FIT_HIGH;
  p.max_modes = 12;
  p.sensor_face = drawn.traits.housing;
  p.sensor_electrode = drawn.traits.electrode;
  p.max_bad_hits = 2 * hits;
  p.tool_material = drawn.traits.young > 4e11 ? "carbide" : "steel";
  p.tool_fluted_length = drawn.traits.flute_length + drawn.fluted_error;
  p.read_height = std::round(drawn.traits.read_height / HEIGHT_STEP) * HEIGHT_STEP;
  task.goal = goalOf(drawn, hits);
  task.goal.stickout = *drawn.believed.stickout + drawn.stickout_error;
  return task;
}

MeasureFrfResult measure(StationMachine& machine, const HammerParameters& parameters,
                         const MachineModel& believed, const MeasureFrfGoal& goal, double& seconds) {
  HammerSequence sequence(parameters, believed);
  const double begin = machine.time();
  sequence.handle(goal);
  StationMachine::Streams streams;
  while (machine.time() < begin + LONGEST) {
    machine.block(streams);
    sequence.handle(streams.samples);
    sequence.handle(streams.state);
    sequence.handle(streams.angle);
    for (const Command& command : sequence.takeCommands()) machine.obey(command);
    if (const auto result = sequence.takeResult()) {
      seconds = machine.time() - begin;
      return *result;
    }
  }
  throw Error("no result within 20 minutes of machine time");
}

}  // namespace smartmill::hammer
