#include "smartmill_sim/world/axes_track.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {

void AxesTrack::push(const SampleBlock& block) {
  const std::array<std::size_t, 3> axis{block.channel("x"), block.channel("y"), block.channel("z")};
  const std::size_t revolutions = block.channel("revolutions");
  const auto tool = std::find(block.channels.begin(), block.channels.end(), "tool");
  for (std::size_t i = 0; i < block.size(); ++i) {
    Point point;
    point.time = block.timeOf(i);
    if (!points_.empty() && !(point.time > points_.back().time)) continue;
    for (std::size_t k = 0; k < 3; ++k) point.position[k] = block.at(i, axis[k]);
    point.revolutions = block.at(i, revolutions);
    if (tool != block.channels.end())
      point.tool = static_cast<int>(block.at(i, static_cast<std::size_t>(tool - block.channels.begin())));
    point.jump =
        !points_.empty() && (points_.back().held || point.time - points_.back().time > longest_step_);
    points_.push_back(point);
  }
}

void AxesTrack::holdUntil(double until) {
  if (points_.empty() || until <= points_.back().time) return;
  Point point = points_.back();
  point.time = until;
  point.jump = false;
  point.held = true;
  points_.push_back(point);
}

std::optional<double> AxesTrack::newest() const {
  return points_.empty() ? std::nullopt : std::optional<double>(points_.back().time);
}

MotionState AxesTrack::at(double time) {
  MotionState state;
  while (points_.size() > 1 && points_[1].time <= time) points_.pop_front();
  if (points_.empty()) return state;
  const Point& a = points_.front();
  state.position = a.position;
  state.tool = a.tool;
  double revolutions = a.revolutions;
  if (points_.size() > 1 && !points_[1].jump && time >= a.time) {
    const Point& b = points_[1];
    const double rate = 1.0 / (b.time - a.time), passed = time - a.time;
    for (std::size_t k = 0; k < 3; ++k) {
      state.velocity[k] = (b.position[k] - a.position[k]) * rate;
      state.position[k] += state.velocity[k] * passed;
    }
    state.spindle_speed = units::TWO_PI * (b.revolutions - a.revolutions) * rate;
    revolutions += (b.revolutions - a.revolutions) * rate * passed;
  }
  state.spindle_angle = wrapped(units::TWO_PI * (revolutions - std::floor(revolutions)));
  return state;
}

}  // namespace smartmill::sim
