#include "smartmill_sim/turning/turning_machine.h"

#include <cmath>

#include "smartmill_core/error.h"

namespace smartmill::sim {
namespace {

double fullScaleOf(const Spindle& spindle) {
  if (!spindle.load_meter_full_scale)
    throw Error("spindle.load_meter_full_scale_v is missing (required to simulate the controller)");
  return *spindle.load_meter_full_scale;
}

}  // namespace

void TurningForces::declare(ParameterTable& table) {
  table.number(
      "tangential_ratio", tangential_ratio, "1", Range::closed(0.0, 10.0),
      "tangential force over the force along the feed (Cheng & Venuvinod, table 2: 485.8 N / 325.8 N)");
  table.number("radial_ratio", radial_ratio, "1", Range::closed(0.0, 10.0),
               "force normal to the feed, away from the workpiece, over the force along the feed");
}

std::array<double, 3> TurningForces::onTool(double feed_force, double angle) const {
  const std::array<double, 3> feed = feedDirection(angle), clear = clearDirection(angle);
  return {feed_force * (-feed[0] + radial_ratio * clear[0]), feed_force * tangential_ratio,
          feed_force * (-feed[2] + radial_ratio * clear[2])};
}

MotorTraits TurningTraits::turningMotors() {
  MotorTraits motor;
  motor.newton_per_ampere = {198.45, 200.0, 215.9};
  motor.coulomb = {60.0, 150.0, 150.0};
  motor.stribeck = {0.0, 0.0, 60.0};
  motor.weight = {318.0, 0.0, 0.0};
  motor.disturbance_period = {0.005, 0.005, 0.005};
  motor.phase_per_metre = {1000.0, 1000.0, 1000.0};
  return motor;
}

void TurningTraits::declare(ParameterTable& table) {
  table.section("Passes in air and in the cut, with motor_currents.");
  table.part("pass_", passes);
  table.part("force_", forces);
  table.part("motor_", motor);
}

TurningMachine::TurningMachine(Lathe& lathe, const TurningTraits& traits, const LatheTraits& lathe_traits,
                               const Spindle& spindle)
    : lathe_(lathe),
      traits_((traits.validate(), traits)),
      rate_(lathe_traits.rate),
      passes_(traits.passes, lathe_traits.spindle_speed),
      motors_(traits.motor, spindle, lathe_traits.seed),
      drive_(spindle, 1.0 / lathe_traits.rate),
      full_scale_(fullScaleOf(spindle)) {
  drive_.reset(lathe_traits.spindle_speed);
}

TurningMachine::Block TurningMachine::advance(std::size_t count) {
  const double begin = static_cast<double>(index_) / rate_;
  Block block;
  if (passes_.advance(begin) || index_ == 0) block.condition = passes_.condition();
  const bool cutting = passes_.isCutting(begin);
  lathe_.engage(cutting ? passes_.feed() : 0.0, passes_.width());
  block.sensors = lathe_.advance(count);
  block.force.stamp = begin;
  block.force.sample_rate = rate_;
  block.force.first_index = index_;
  MotorCurrents::Input input;
  for (std::size_t i = 0; i < count; ++i, ++index_) {
    input.time = static_cast<double>(index_) / rate_;
    input.motion = passes_.state(input.time);
    input.force = traits_.forces.onTool(block.sensors.force[i], passes_.angle());
    input.torque = input.force[1] * passes_.radius(input.time);
    motors_.push(input);
    voltage_ = drive_.step(input.torque, input.motion.spindle_speed);
    for (std::size_t a = 0; a < 3; ++a) block.force.force[a].push_back(input.force[a]);
  }
  block.motor_current = motors_.take();
  const double end = static_cast<double>(index_) / rate_;
  const auto& velocity = input.motion.velocity;
  CncState& state = block.state;
  state.stamp = end;
  state.connected = true;
  state.mode = CncMode::mem;
  state.run = CncRun::start;
  state.feed = std::hypot(velocity[0], velocity[1], velocity[2]);
  state.motion = state.feed > 0.0;
  state.axes = {"X", "Y", "Z"};
  state.position.assign(input.motion.position.begin(), input.motion.position.end());
  const auto to_go = passes_.distanceToGo(input.time);
  state.distance_to_go.assign(to_go.begin(), to_go.end());
  state.spindle_speed = input.motion.spindle_speed;
  block.load.stamp = end;
  block.load.spindle_load = drive_.rounded(voltage_) / full_scale_;
  block.load.spindle_speed = input.motion.spindle_speed;
  return block;
}

}  // namespace smartmill::sim
