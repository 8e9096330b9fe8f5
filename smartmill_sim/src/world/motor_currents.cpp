#include "smartmill_sim/world/motor_currents.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double REFERENCE = 20.0;    // [deg C] of the constants
constexpr double LEAST_SPEED = 1e-7;  // [m/s]

}  // namespace

void MotorTraits::declare(ParameterTable& table) {
  table.section("Motors: signals of a Hall sensor at one phase of each (daq/motor_current).");
  table.flag("currents", currents,
             "whether daq/motor_current is published; daq/servo then uses the drives below too");
  table.list("mass", mass, "kg", Range::openLow(0.0, 1e5),
             "moved mass of X, Y, Z, inertia of the motor included");
  table.list("coulomb", coulomb, "N", Range::closed(0.0, 1e4), "dry friction of X, Y, Z");
  table.list("viscous", viscous, "N s/m", Range::closed(0.0, 1e6), "viscous friction of X, Y, Z");
  table.list("stribeck", stribeck, "N", Range::closed(0.0, 1e4),
             "excess of the dry friction at vanishing speed over coulomb");
  table.number("stribeck_velocity", stribeck_velocity, "m/s", Range::openLow(0.0, 1.0),
               "speed at which this excess has fallen to 1/e");
  table.list("weight", weight, "N", Range::closed(-1e5, 1e5),
             "of the slide, towards the negative end of X, Y, Z");
  table.list("disturbance", disturbance, "N", Range::closed(0.0, 1e4),
             "amplitude of a force periodic in the position");
  table.list("disturbance_period", disturbance_period, "m", Range::openLow(0.0, 10.0), "lead of the screws");
  table.list("newton_per_ampere", newton_per_ampere, "N/A", Range::openLow(0.0, 1e6),
             "force over the range of the phase current");
  table.list("phase_per_metre", phase_per_metre, "1/m", Range::openLow(0.0, 1e7),
             "electrical periods per length, pole pairs / lead");
  table.number("spindle_torque_per_ampere", spindle_torque_per_ampere, "N m/A", Range::openLow(0.0, 1e4),
               "torque over the range of the phase current, below base speed");
  table.number("spindle_magnetising", spindle_magnetising, "A", Range::closed(0.0, 1e4),
               "range of the phase current without load, below base speed");
  table.number("spindle_base_speed", spindle_base_speed, "rad/s", Range::openLow(0.0, 1e4),
               "base speed; constant power above it");
  table.number("spindle_phase_per_revolution", spindle_phase_per_revolution, "1", Range::openLow(0.0, 1000.0),
               "electrical periods per revolution, pole pairs");
  table.number("spindle_slip", spindle_slip, "1/(N m)", Range::closed(0.0, 0.1),
               "relative excess of the electrical frequency over the speed, per torque");
  table.number("bandwidth", bandwidth, "Hz", Range::openLow(0.0, 480.0),
               "bandwidth of the currents over the load");
  table.number("temperature", temperature, "1", Range::closed(-20.0, 80.0),
               "[deg C] temperature of shop and cold machine");
  table.number("warm_up", warm_up, "1", Range::closed(0.0, 10.0),
               "[K/W] temperature rise of the drives over the friction power");
  table.number("warm_up_time", warm_up_time, "s", Range::openLow(0.0, 1e6), "time constant of the warm-up");
  table.number("friction_per_kelvin", friction_per_kelvin, "1", Range::closed(0.0, 0.05),
               "[1/K] relative decrease of friction above 20 deg C");
  table.number("gain_per_kelvin", gain_per_kelvin, "1", Range::closed(0.0, 0.02),
               "[1/K] relative decrease of force and torque per ampere above 20 deg C");
  table.number("harmonic", harmonic, "1", Range::closed(0.0, 0.5),
               "relative amplitude of the fifth harmonic of a phase");
  table.number("noise", noise, "A", Range::closed(0.0, 100.0), "RMS of a Hall sensor");
}

std::array<AxisDrive, 3> MotorTraits::drives() const {
  std::array<AxisDrive, 3> drives;
  if (!currents) return drives;
  for (std::size_t a = 0; a < 3; ++a) {
    drives[a].mass = mass[a];
    drives[a].coulomb = coulomb[a];
    drives[a].viscous = viscous[a];
    drives[a].stribeck = stribeck[a];
    drives[a].stribeck_velocity = stribeck_velocity;
    drives[a].weight = weight[a];
    drives[a].disturbance = disturbance[a];
    drives[a].disturbance_period = disturbance_period[a];
  }
  return drives;
}

MotorCurrents::MotorCurrents(const MotorTraits& traits, const Spindle& spindle, std::uint64_t seed)
    : traits_(traits),
      drives_(traits.drives()),
      spindle_(spindle),
      random_(seed ^ 0x6d6f746f72ULL),
      temperature_(traits.temperature) {
}

double MotorCurrents::spindleRange(double torque, double speed) const {
  // Field weakening above base speed: less torque per ampere, less magnetising current (constant power).
  const double field = std::min(1.0, traits_.spindle_base_speed / std::max(std::abs(speed), 1e-9));
  const double gain = 1.0 - traits_.gain_per_kelvin * (temperature_ - REFERENCE);
  return std::hypot(traits_.spindle_magnetising * field,
                    torque / (traits_.spindle_torque_per_ampere * field * gain));
}

double MotorCurrents::phase(double range, double periods) {
  const double turned = units::TWO_PI * (periods - std::floor(periods));
  return 0.5 * range * (std::sin(turned) + traits_.harmonic * std::sin(5.0 * turned)) +
         traits_.noise * normal_(random_);
}

void MotorCurrents::push(const Input& input) {
  DriveState now;
  now.time = input.time;
  now.position = input.motion.position;
  now.speed = input.motion.spindle_speed;
  if (started_) {
    now.turns =
        last_.turns + std::remainder(input.motion.spindle_angle - last_angle_, units::TWO_PI) / units::TWO_PI;
  }
  last_angle_ = input.motion.spindle_angle;
  for (std::size_t a = 0; a < 3; ++a) cut_[a] += input.force[a];
  torque_ += input.torque;
  count_ += 1.0;
  if (!started_) {
    index_ = static_cast<std::uint64_t>(std::ceil(input.time * SAMPLE_RATE - 1e-9));
    started_ = true;
    last_ = sampled_ = now;
  }
  // Skipped samples are a jump of the index.
  if (static_cast<double>(index_ + 1) / SAMPLE_RATE <= input.time)
    index_ = static_cast<std::uint64_t>(input.time * SAMPLE_RATE);
  const double sample_time = static_cast<double>(index_) / SAMPLE_RATE;
  if (sample_time <= input.time + 1e-12) {
    const double span = now.time - last_.time, share = span > 0.0 ? (sample_time - last_.time) / span : 1.0;
    DriveState at = now;
    at.time = sample_time;
    for (std::size_t a = 0; a < 3; ++a) {
      at.position[a] = last_.position[a] + share * (now.position[a] - last_.position[a]);
    }
    at.turns = last_.turns + share * (now.turns - last_.turns);
    sample(at);
  }
  last_ = now;
}

void MotorCurrents::sample(const DriveState& at) {
  const double step = at.time - sampled_.time;
  const double follow = 1.0 - std::exp(-units::TWO_PI * traits_.bandwidth / SAMPLE_RATE);
  const double friction_factor =
      std::max(0.1, 1.0 - traits_.friction_per_kelvin * (temperature_ - REFERENCE));
  const double gain = 1.0 - traits_.gain_per_kelvin * (temperature_ - REFERENCE);
  double power = 0.0;  // [W] of friction
  if (samples_.empty()) block_index_ = index_;
  for (std::size_t a = 0; a < 3; ++a) {
    const double velocity = step > 0.0 ? (at.position[a] - sampled_.position[a]) / step : 0.0;
    const double acceleration = step > 0.0 ? (velocity - velocity_[a]) / step : 0.0;
    const double cut = cut_[a] / count_;
    double load = 0.0;
    if (std::abs(velocity) > LEAST_SPEED) {
      load = drives_[a].force(at.position[a], velocity, acceleration, cut, friction_factor);
      power += std::abs(drives_[a].friction(velocity, friction_factor) * velocity);
    } else {
      // At rest dry friction carries the load up to its limit, the motor the excess.
      const double dry_friction = friction_factor * (drives_[a].coulomb + drives_[a].stribeck);
      load = drives_[a].weight - cut;
      load -= std::clamp(load, -dry_friction, dry_friction);
    }
    velocity_[a] = velocity;
    load_[a] += follow * (load - load_[a]);
    samples_.push_back(
        phase(load_[a] / (traits_.newton_per_ampere[a] * gain), traits_.phase_per_metre[a] * at.position[a]));
  }
  const double speed = std::abs(at.speed);
  const double friction = spindle_.friction().at(speed, 0.0, friction_factor);
  torque_load_ += follow * (torque_ / count_ + friction - torque_load_);
  power += friction * speed;
  slip_revolutions_ += traits_.spindle_slip * torque_load_ * std::abs(at.turns - sampled_.turns);
  samples_.push_back(speed > 0.0
                         ? phase(spindleRange(torque_load_, speed),
                                 traits_.spindle_phase_per_revolution * (at.turns + slip_revolutions_))
                         : traits_.noise * normal_(random_));
  temperature_ += std::max(0.0, step) / traits_.warm_up_time *
                  (traits_.temperature + traits_.warm_up * power - temperature_);
  cut_ = {};
  torque_ = count_ = 0.0;
  sampled_ = at;
  ++index_;
}

SampleBlock MotorCurrents::take() {
  SampleBlock block;
  block.stamp = static_cast<double>(block_index_) / SAMPLE_RATE;
  block.sample_rate = SAMPLE_RATE;
  block.first_index = block_index_;
  block.channels = {"x", "y", "z", "spindle"};
  block.units = {"A", "A", "A", "A"};
  block.samples = std::exchange(samples_, {});
  return block;
}

}  // namespace smartmill::sim
