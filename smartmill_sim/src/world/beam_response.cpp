#include "smartmill_sim/world/beam_response.h"

#include <cmath>

namespace smartmill::sim {
namespace {

constexpr double SAME_HEIGHT = 1e-7;  // [m]

}  // namespace

BeamResponse::BeamResponse(const StationTraits& traits, const ToolGeometry& tool, double stickout,
                           double offset, double step)
    : structure_(traits, tool, stickout), offset_(offset), step_(step), decay_time_(traits.decay_time) {
  for (std::size_t axis = 0; axis < 2; ++axis) setHeight(axis, traits.read_height);
}

void BeamResponse::setHeight(std::size_t struck_axis, double height) {
  Path& path = paths_[struck_axis];
  if (!path.tip.empty() && std::abs(height - path.height) < SAME_HEIGHT) return;
  const auto filter = [&](std::size_t read_axis, double read) {
    return ModalFilter(structure_.between(read_axis, read, struck_axis, height + offset_), 1.0 / step_,
                       Hold::first_order);
  };
  path = {{filter(0, height), filter(1, height)}, {filter(0, 0.0), filter(1, 0.0)}, height};
}

void BeamResponse::reset() {
  vibrates_until_ = -1.0;
  at_sensor_ = {{0, 0}};
  for (Path& path : paths_) {
    for (ModalFilter& f : path.read) f.reset();
    for (ModalFilter& f : path.tip) f.reset();
  }
}

bool BeamResponse::vibrates(double time, double force) {
  if (force != 0.0) vibrates_until_ = time + decay_time_;
  return time < vibrates_until_;
}

std::array<double, 2> BeamResponse::step(std::size_t struck_axis, double force) {
  Path& path = paths_[struck_axis];
  std::array<double, 2> tip{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    at_sensor_[axis] = path.read[axis].step(force);
    tip[axis] = path.tip[axis].step(force);
  }
  return tip;
}

}  // namespace smartmill::sim
