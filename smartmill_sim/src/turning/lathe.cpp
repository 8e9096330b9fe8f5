#include "smartmill_sim/turning/lathe.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

ModalModel machineOf(const LatheTraits& t) {
  ModalModel model;
  for (std::size_t k = 0; k < t.frequency.size(); ++k)
    model.modes.push_back({t.frequency[k], t.damping_ratio[k], 1.0 / t.stiffness[k]});
  return model;
}

}  // namespace

void LatheTraits::declare(ParameterTable& table) {
  table.number("seed", seed, "1", Range::notNegative(), "seed of the noise");
  table.number("rate", rate, "Hz", Range::closed(1000.0, 1e5), "sample rate");
  table.section("Cut.");
  table.number("spindle_speed", spindle_speed, "rad/s", Range::openLow(0.0, 1000.0), "of the workpiece");
  table.number("chip", chip, "m", Range::openLow(0.0, 1e-2), "nominal chip thickness, feed per revolution");
  table.number("overlap", overlap, "1", Range::closed(0.0, 1.0), "overlap of successive cuts");
  table.number("cutting_stiffness", cutting_stiffness, "N/m", Range::openLow(0.0, 1e10),
               "slope of the force at the nominal chip thickness");
  table.number("chip_exponent", chip_exponent, "1", Range::closed(0.3, 1.5),
               "exponent of the force over the chip thickness; 1: proportional");
  table.section("Machine: modes between cutting edge and workpiece.");
  table.list("frequency", frequency, "Hz", Range::openLow(0.0, 1e4), "of each mode");
  table.list("damping_ratio", damping_ratio, "1", Range::open(0.0, 1.0), "of each");
  table.list("stiffness", stiffness, "N/m", Range::openLow(0.0, 1e12), "of each");
  table.section("Fast tool servo and sensors.");
  table.number("servo_frequency", servo_frequency, "Hz", Range::openLow(0.0, 1e5),
               "natural frequency of the servo");
  table.number("servo_damping", servo_damping, "1", Range::open(0.0, 1.0), "damping ratio of the servo");
  table.number("servo_delay", servo_delay, "s", Range::closed(0.0, 0.1), "delay of the servo");
  table.number("servo_stroke", servo_stroke, "m", Range::openLow(0.0, 0.1), "limit in either direction");
  table.number("probe_noise", probe_noise, "m", Range::notNegative(), "RMS of the displacement probes");
  table.number("accelerometer_noise", accelerometer_noise, "m/s2", Range::notNegative(),
               "RMS of the accelerometer");
}

void LatheTraits::validate() const {
  checkBounds(*this);
  if (frequency.empty() || damping_ratio.size() != frequency.size() || stiffness.size() != frequency.size())
    throw Error("frequency, damping_ratio, stiffness: " + std::to_string(frequency.size()) + ", " +
                std::to_string(damping_ratio.size()) + ", " + std::to_string(stiffness.size()) +
                " values, expected one of each per mode");
  if (rate * units::TWO_PI / spindle_speed < 3.0)
    throw Error("spindle_speed: " + std::to_string(spindle_speed) +
                " rad/s is too fast, expected at least three samples per revolution");
}

Lathe::Lathe(const LatheTraits& traits)
    : traits_((traits.validate(), traits)),
      machine_(machineOf(traits), traits.rate, Hold::first_order),
      servo_filter_(ModalModel{{{traits.servo_frequency, traits.servo_damping, 1.0}}, 0.0}, traits.rate,
                    Hold::zero_order),
      random_(traits.seed),
      feed_(traits.chip) {
}

void Lathe::engage(double feed, double width) {
  feed_ = feed;
  width_ = width;
}

void Lathe::command(const SampleBlock& commands) {
  const std::size_t channel = commands.channel("command");
  if (commands.units.at(channel) != "m")
    throw Error("command: the unit is " + commands.units.at(channel) + ", expected m");
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const std::uint64_t index = commands.first_index + i;
    const double value = commands.at(i, channel);
    if (!std::isfinite(value)) throw Error("command: a value is not finite");
    if (index < index_) ++late_;
    commands_[index] = value;
    newest_ = std::max(newest_, index);
  }
}

// Tool position at the next sample.
double Lathe::servo() {
  while (!commands_.empty() && commands_.begin()->first < index_) {
    commanded_ = std::clamp(commands_.begin()->second, -traits_.servo_stroke, traits_.servo_stroke);
    commands_.erase(commands_.begin());
  }
  delayed_.push_front(commanded_);
  const auto delay = static_cast<std::size_t>(std::lround(traits_.servo_delay * traits_.rate));
  const double delayed = delayed_.size() > delay ? delayed_[delay] : 0.0;
  if (delayed_.size() > delay + 1) delayed_.pop_back();
  return servo_filter_.step(delayed);
}

double Lathe::force(double chip) const {
  if (chip <= 0.0) return 0.0;
  // Slope K at the nominal chip: K h0 / m (h / h0)^m.
  const double m = traits_.chip_exponent;
  return width_ * traits_.cutting_stiffness * traits_.chip / m * std::pow(chip / traits_.chip, m);
}

double Lathe::pastSurface() const {
  const double back = units::TWO_PI / traits_.spindle_speed * traits_.rate;
  const auto whole_steps = static_cast<std::size_t>(back);
  if (whole_steps >= surface_.size()) return 0.0;
  // surface_[k] is k + 1 samples old.
  const double share = back - static_cast<double>(whole_steps);
  return surface_[whole_steps - 1] + share * (surface_[whole_steps] - surface_[whole_steps - 1]);
}

Lathe::Block Lathe::advance(std::size_t count) {
  Block block;
  const double stamp = static_cast<double>(index_) / traits_.rate;
  const auto head = [&](SampleBlock& b, std::vector<std::string> channels, std::vector<std::string> unit) {
    b.stamp = stamp;
    b.sample_rate = traits_.rate;
    b.first_index = index_;
    b.channels = std::move(channels);
    b.units = std::move(unit);
  };
  head(block.displacement, {"deflection", "tool", "headstock"}, {"m", "m", "m/s2"});
  head(block.vibration, {"headstock"}, {"m/s2"});
  block.angle = {stamp, std::fmod(traits_.spindle_speed * stamp, units::TWO_PI), traits_.spindle_speed};
  const auto longest = static_cast<std::size_t>(units::TWO_PI / traits_.spindle_speed * traits_.rate) + 3;
  for (std::size_t i = 0; i < count; ++i, ++index_) {
    tool_ = servo();
    const double past = traits_.overlap * pastSurface();
    // Fixed-point iteration: the force depends on the deflection in the same sample; each pass reduces the
    // error to about 1 %.
    double acting = feed_ > 0.0 ? last_force_ : 0.0;
    for (int turn = 0; turn < 4 && feed_ > 0.0; ++turn)
      acting = force(feed_ - (machine_.peek(acting) - tool_) + past);
    const double deflection = machine_.step(acting);
    const double motion = deflection - tool_;
    // Out of the cut the old surface remains, one feed farther away.
    const double missed = feed_ > 0.0 ? feed_ + past : 0.0;
    surface_.push_front(acting > 0.0 ? motion : missed);
    if (surface_.size() > longest) surface_.pop_back();
    last_force_ = acting;
    block.displacement.samples.push_back(deflection + traits_.probe_noise * normal_(random_));
    block.displacement.samples.push_back(tool_ + traits_.probe_noise * normal_(random_));
    const double acceleration = machine_.acceleration() + traits_.accelerometer_noise * normal_(random_);
    block.displacement.samples.push_back(acceleration);
    block.vibration.samples.push_back(acceleration);
    block.motion.push_back(motion);
    block.force.push_back(acting);
  }
  return block;
}

}  // namespace smartmill::sim
