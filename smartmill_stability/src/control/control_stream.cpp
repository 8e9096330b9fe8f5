#include "smartmill_stability/control/control_stream.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {

void ControlStreamParameters::validate() const {
  checkBounds(*this);
  controller.validate();
}

ControlStream::ControlStream(const ControlStreamParameters& parameters, Learnt learnt)
    : parameters_(parameters), learnt_(std::move(learnt)) {
  parameters_.validate();
}

void ControlStream::handle(const SpindleAngle& angle) {
  if (!(angle.speed > 0.0) || std::abs(angle.speed - speed_) <= parameters_.speed_tolerance * speed_) return;
  speed_ = angle.speed;
  controller_.reset();
}

std::optional<SampleBlock> ControlStream::handle(const SampleBlock& block) {
  const std::size_t deflection = block.channel(parameters_.deflection_channel);
  const std::size_t tool = block.channel(parameters_.tool_channel);
  const std::string& unit = block.units.at(deflection);
  if (unit != "m" && unit != "m/s2")
    throw Error("channel " + parameters_.deflection_channel + ": unit " + unit + ": expected m or m/s2");
  if (block.units.at(tool) != "m")
    throw Error("channel " + parameters_.tool_channel + ": unit " + block.units.at(tool) + ": expected m");
  if (!(speed_ > 0.0)) return std::nullopt;
  if (!controller_ || block.first_index != next_index_ || block.stamp < last_stamp_ ||
      block.sample_rate != rate_) {
    ControllerParameters controller = parameters_.controller;
    controller.rate = block.sample_rate;
    controller.period = units::TWO_PI / speed_;
    controller_.emplace(controller);
    integrator_.reset();
    if (unit == "m/s2") integrator_.emplace(parameters_.integrator_corner, block.sample_rate);
    rate_ = block.sample_rate;
  }
  next_index_ = block.first_index + block.size();
  last_stamp_ = block.stamp;
  SampleBlock commands;
  const double lead = parameters_.controller.lead;
  commands.stamp = block.stamp + lead;
  commands.sample_rate = block.sample_rate;
  commands.first_index =
      block.first_index + static_cast<std::uint64_t>(std::lround(lead * block.sample_rate));
  commands.channels = {"command"};
  commands.units = {"m"};
  for (std::size_t i = 0; i < block.size(); ++i) {
    const double measured = block.at(i, deflection);
    const std::size_t before = controller_->segments().size();
    commands.samples.push_back(
        controller_->step(integrator_ ? integrator_->step(measured) : measured, block.at(i, tool)));
    if (controller_->segments().size() > before && learnt_)
      learnt_({block.timeOf(i), controller_->estimates().back(), controller_->active(),
               controller_->segments().back().informed});
  }
  return commands;
}

}  // namespace smartmill::stability
