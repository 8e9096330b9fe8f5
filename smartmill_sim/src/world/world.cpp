#include "smartmill_sim/world/world.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/controller/nc_alarm.h"
#include "world/world_sensor.h"

namespace smartmill::sim {
namespace {

using Lock = std::lock_guard<std::mutex>;

constexpr double WHOLE_TOOTH = 1e-3;           // [m] more than any chip
constexpr std::uint64_t FLANGE_SEED = 0x1000;  // offset from the seed of the world

double stepOf(const WorldOptions& options) {
  return 1.0 / (World::SAMPLE_RATE * options.substeps);
}

/// The model with the tool structure of the hammer station, if it defines one.
MachineModel withStructure(MachineModel model, const std::optional<HammerStation>& station) {
  const std::optional<ToolTip> tip = station ? station->tip() : std::nullopt;
  if (tip) model.tool_tip = *tip;
  return model;
}

/// A machine with the tool of another model.
MachineModel withTool(MachineModel machine, const MachineModel& other) {
  machine.tool = other.needTool("put it into the magazine");
  if (other.cutting) machine.cutting = other.cutting;
  if (!other.tool_tip.x.modes.empty() || !other.tool_tip.y.modes.empty()) machine.tool_tip = other.tool_tip;
  return machine;
}

std::optional<HammerStation> stationOf(const MachineModel& model, const WorldOptions& options) {
  if (!model.hammer || !model.tool) return std::nullopt;
  return HammerStation(model, options.hammer, options.force_scatter, stepOf(options));
}

double fullScaleOf(const MachineModel& model) {
  const std::optional<double>& scale = model.needSpindle("simulate the machine").load_meter_full_scale;
  if (scale) return *scale;
  throw Error(model.file + ": spindle.load_meter_full_scale_v is missing (needed to simulate the machine)");
}

ControllerOptions controllerOptions(const MachineModel& model, const WorldOptions& options) {
  ControllerOptions controller_options = ControllerOptions::ofModel(model);
  controller_options.load_step = 100.0 * options.load_step / fullScaleOf(model);
  controller_options.motor_temperature = options.motor.temperature;
  for (const auto& [number, tool] : options.magazine) controller_options.magazine.push_back(number);
  return controller_options;
}

const WorldOptions& validated(const WorldOptions& options) {
  options.validate();
  return options;
}

}  // namespace

void WorldOptions::validate() const {
  checkBounds(*this);
  hammer.validate();
  spindle_sensor.validate();
}

World::World(const MachineModel& model, const WorldOptions& options)
    : options_(validated(options)),
      full_scale_(fullScaleOf(model)),
      controller_(controllerOptions(model, options)),
      servo_(options.servo_trigger, options.motor.drives()),
      station_(stationOf(model, options)),
      tip_(withStructure(model, station_).tool_tip),
      workpiece_(model.workpiece),
      random_{std::mt19937_64(options.seed), {}} {
  model.needTool("simulate the machine");
  model.needCutting("simulate the machine");
  model.needAxes("simulate the machine");
  const MachineModel structured = withStructure(model, station_);
  addTool(0, structured);
  for (const auto& [number, tool] : options.magazine) addTool(number, withTool(structured, tool));
  tool_ = &tools_.at(0);
  if (workpiece_) stock_.emplace(*workpiece_, tool_->geometry());
  last_ = controller_.motion();
  const PlacedFrame dynamometer = placedFrame(model.frames, frames::DYNAMOMETER, frames::MACHINE);
  if (dynamometer.isTurned()) {
    if (options.plate.present)
      throw Error(model.file + ": frames.dynamometer is turned, expected an aligned one with plate_present");
    const std::array<double, 9>& r = dynamometer.rotation;
    for (auto& [number, tool] : tools_)
      tool.machine.turnSensor({r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]});
    manual_.from_sensor = r;
  }
  if (options.spindle_sensor.present)
    flange_.emplace(options.spindle_sensor, stepOf(options), SAMPLE_RATE, options.seed + FLANGE_SEED);
  sensors_ = makeSensors({model, options, stepOf(options), station_ ? &*station_ : nullptr,
                          flange_ ? &*flange_ : nullptr, servo_, manual_, random_});
}

World::~World() = default;

void World::addTool(int number, const MachineModel& model) {
  MountedTool& tool = tools_.try_emplace(number, model, stepOf(options_)).first->second;
  tool.shortening.assign(static_cast<std::size_t>(model.tool->teeth), 0.0);
  tool.machine.resetLoadMeter(0.0);
}

/// The spindle is at rest. Drift and hum of the force sensor restart.
void World::changeTool(int number) {
  const auto found = tools_.find(number);
  if (found == tools_.end() || &found->second == tool_) return;
  EffectTimeline::Clock clock = found->second.machine.clock();
  clock.start_time = tool_->machine.clock().start_time;
  tool_ = &found->second;
  tool_->machine.setClock(clock);
  tool_->machine.resetLoadMeter(last_.spindle_speed);
  if (stock_) stock_->changeTool(tool_->geometry());
}

World::StrikeAnswer World::strike(const std::string& point, const std::string& direction,
                                  std::string& message) {
  const Lock lock(mutex_);
  const std::size_t axis = direction == "x" ? 0 : direction == "y" ? 1 : direction == "z" ? 2 : 3;
  const double now = static_cast<double>(index_) / SAMPLE_RATE;
  if (manual_.hitting(now) || (station_ && station_->busy(now))) {
    message = "the previous hit is still in progress";
    return StrikeAnswer::failed;
  }
  const bool tool = point == "tool";
  const bool before_hammer = station_ && axis < 2 && (!flange_ || station_->facing(last_.position) == axis);
  if (tool && before_hammer) {
    // At a random time between two samples.
    station_->fire(axis, now, now + options_.hammer_delay + random_.uniform() / SAMPLE_RATE, random_.engine);
    message = "hammer fired in " + direction;
  } else if (tool && flange_ && axis < 3) {
    manual_.hit(true, axis, drawHit(now));
    message = "hammer fired on the tool's tip in " + direction;
  } else if (point == "force_sensor" && axis < 3) {
    manual_.hit(false, axis, drawHit(now));
    message = options_.operator_delay > 0.0 ? "hit the workpiece by hand in " + direction
                                            : "hammer fired on the workpiece in " + direction;
  } else {
    message = "no hammer for point '" + point + "', direction '" + direction + "'";
    return StrikeAnswer::failed;
  }
  return tool || options_.operator_delay == 0.0 ? StrikeAnswer::ok : StrikeAnswer::by_hand;
}

/// Hit by an automatic hammer or by hand.
Hit World::drawHit(double now) {
  const double delay = options_.operator_delay > 0.0 ? options_.operator_delay : options_.hammer_delay;
  const double begin = now + delay + random_.uniform() / SAMPLE_RATE;
  const double scatter = std::clamp(1.0 + random_.gaussian(options_.force_scatter), 0.5, 1.5);
  return {begin, options_.tap_peak * scatter, options_.tap_contact, 0.0};
}

void World::pull(const std::array<double, 3>& force, bool on_table) {
  const Lock lock(mutex_);
  manual_.pull(force, on_table);
}

void World::setToolLength(double length) {
  const Lock lock(mutex_);
  if (!flange_) throw Error("tool length: the spindle has no force sensor that depends on it");
  flange_->setLength(length);
}

void World::setTapPoint(const std::array<double, 3>& point) {
  const Lock lock(mutex_);
  manual_.tap_point = point;
}

void World::changeWorkpiece() {
  const Lock lock(mutex_);
  if (!workpiece_) throw Error("workpiece: the model states none");
  if (last_.spindle_speed > 0.0) throw Error("workpiece: the spindle turns, expected at rest");
  stock_.emplace(*workpiece_, tool_->geometry());
}

void World::advance(Block& block) {
  const Lock lock(mutex_);
  controller_.advance(1.0 / SAMPLE_RATE, BLOCK, states_);
  simulateBlock(block, states_);
  controller_.setSpindleLoad(100.0 * load_meter_ / full_scale_);
  controller_.setSpindleTorque(torque_ / BLOCK);
  controller_.setServoCurrent(servo_.current());
  controller_.setServoLoad(servo_.load());
}

void World::advance(Block& block, const std::vector<MotionState>& states) {
  if (states.size() != BLOCK)
    throw Error("axes: " + std::to_string(states.size()) + " states, expected one block");
  const Lock lock(mutex_);
  simulateBlock(block, states);
}

double World::breakTooth(int tooth, double length) {
  const Lock lock(mutex_);
  const auto teeth = static_cast<int>(tool_->shortening.size());
  if (tooth < 0 || tooth > teeth)
    throw Error("tooth: " + std::to_string(tooth) + ", expected 1.." + std::to_string(teeth) +
                " or 0 for a new tool");
  if (!(length >= 0.0 && std::isfinite(length)))
    throw Error("length: " + std::to_string(length) + " m, expected at least 0");
  std::vector<double> shortening = tool_->shortening;
  if (tooth == 0) {
    shortening.assign(shortening.size(), 0.0);
  } else {
    shortening[static_cast<std::size_t>(tooth) - 1] = length > 0.0 ? length : WHOLE_TOOTH;
  }
  tool_->machine.shortenTeeth(shortening);
  tool_->shortening = shortening;
  return static_cast<double>(index_) / SAMPLE_RATE;
}

void World::skipSamples(std::uint64_t samples) {
  const Lock lock(mutex_);
  index_ += samples;
  const double time = static_cast<double>(samples) / SAMPLE_RATE;
  manual_.skipTime(time);
  if (flange_) flange_->skipTime(time);
  if (station_) station_->skipTime(time);
}

void World::simulateBlock(Block& block, const std::vector<MotionState>& states) {
  for (const auto& sensor : sensors_) sensor->begin(static_cast<double>(index_) / SAMPLE_RATE, index_, block);
  torque_ = 0.0;
  for (std::size_t i = 0; i < BLOCK; ++i) {
    if (states[i].tool != last_.tool) changeTool(states[i].tool);
    const bool stopped = tool_->machine.cutting() && !(states[i].spindle_speed > 0.0);
    if ((index_ + i) % options_.contact_update == 0 || stopped) updateContact(states[i]);
    simulateSample(static_cast<double>(index_ + i) / SAMPLE_RATE, states[i], block);
    last_ = states[i];
  }
  for (std::size_t k = 0; k < ANGLES; ++k) {
    const std::size_t i = BLOCK * (k + 1) / ANGLES - 1;
    block.angle[k] = {(static_cast<double>(index_ + i) + 0.5) / SAMPLE_RATE, states[i].spindle_angle,
                      states[i].spindle_speed};
  }
  index_ += BLOCK;
  for (const auto& sensor : sensors_) sensor->end(block);
  block.spindle_load = tool_->machine.rounded(load_meter_) / full_scale_;
}

void World::updateContact(const MotionState& state) {
  if (!stock_) return;
  ToolMotion now = between(state, 0.0);
  now.speed = state.spindle_speed;  // as its velocity: the spindle may have been at rest before
  const StockContact::Fault fault = stock_->update(state, now, tool_->machine);
  if (fault.alarm != 0) raiseAlarm(fault.alarm, fault.text);
}

/// Simulates a sample. Sensor signals are averaged over the interval centred on the sample, as by an
/// anti-aliasing filter: otherwise the spectrum of a short hit above half the sample rate would alias
/// differently in force and response. @param now state half a sample after the sample
void World::simulateSample(double time, const MotionState& now, Block& block) {
  if (station_) station_->setPose({now.position, now.spindle_angle, now.spindle_speed}, random_.engine);
  CuttingForce sum;
  for (int s = 0; s < options_.substeps; ++s) {
    const double share = (s + 0.5) / options_.substeps, at = time + (share - 0.5) / SAMPLE_RATE;
    const ManualForces::Forces manual = manual_.at(at);
    HammerStation::Push push;
    if (station_) push = station_->push(at);
    CuttingMachine::Input input;
    input.motion = between(now, share);
    for (std::size_t axis = 0; axis < 2; ++axis)
      input.tip_force[axis] = push.tip_force[axis] + manual.tip_hit[axis];
    input.sensor_force = manual.table;
    const CuttingMachine::Output output = tool_->machine.step(input);
    for (const auto& sensor : sensors_) sensor->step({input, output, push, manual, now.position[2]});
    sum.add(output.force);
    load_meter_ = output.load_meter;
  }
  const double share = 1.0 / options_.substeps;
  torque_ += share * sum.torque;
  const WorldSensor::Sample sample{
      time, now, share, {share * sum.fx, share * sum.fy, share * sum.fz}, share * sum.torque, load_meter_};
  for (const auto& sensor : sensors_) sensor->read(sample, block);
  if (station_ && station_->touched()) raiseAlarm(EX_COLLISION, "TOOL MET THE DISPLACEMENT SENSOR");
}

ToolMotion World::between(const MotionState& now, double share) const {
  ToolMotion motion;
  motion.angle =
      last_.spindle_angle + share * std::remainder(now.spindle_angle - last_.spindle_angle, units::TWO_PI);
  motion.speed = last_.spindle_speed + share * (now.spindle_speed - last_.spindle_speed);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    motion.centre[axis] = last_.position[axis] + share * (now.position[axis] - last_.position[axis]);
    motion.velocity[axis] = now.velocity[axis];
  }
  motion.sink = -now.velocity[2];
  return motion;
}

void World::raiseAlarm(int number, const char* text) {
  if (controller_.calls().state.status().alarm == 0) controller_.raiseAlarm(number, text);
}

}  // namespace smartmill::sim
