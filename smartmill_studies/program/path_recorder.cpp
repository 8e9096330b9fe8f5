#include "program/path_recorder.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

/// Index of the last item with a stamp that is not after a time, or of the first item.
template <class Item>
std::size_t lastAt(const std::vector<Item>& items, double time) {
  const auto after = std::upper_bound(items.begin(), items.end(), time,
                                      [](double t, const Item& item) { return t < item.stamp; });
  return after == items.begin() ? 0 : static_cast<std::size_t>(after - items.begin()) - 1;
}

}  // namespace

void PathRecorder::push(const sim::World::Block& block) {
  const SampleBlock& forces = block.dynamometer;
  rate_ = forces.sample_rate;
  for (std::size_t i = 0; i < forces.size(); ++i) {
    time_.push_back(forces.timeOf(i));
    for (std::size_t a = 0; a < force_.size(); ++a)
      force_[a].push_back(forces.at(i, forces.channel(FORCE_CHANNELS[a])));
  }
  angles_.insert(angles_.end(), block.angle.begin(), block.angle.end());
}

Record PathRecorder::record(double full_scale, double begin, double end) const {
  Record record;
  std::array<std::vector<double>, 3> force, position;
  std::vector<double> angle, load;
  for (std::size_t i = 0; i < time_.size(); ++i) {
    const double t = time_[i];
    if (t < begin || t > end) continue;
    record.time.push_back(static_cast<double>(record.time.size()) / rate_);
    for (std::size_t a = 0; a < 3; ++a) force[a].push_back(force_[a][i]);
    const SpindleAngle& turned = angles_[lastAt(angles_, t)];
    const double now = std::fmod(turned.angle + turned.speed * (t - turned.stamp), units::TWO_PI);
    angle.push_back(now < 0.0 ? now + units::TWO_PI : now);
    load.push_back(loads_.empty() ? 0.0 : full_scale * loads_[lastAt(loads_, t)].spindle_load);
    const std::size_t k = lastAt(states_, t), next = std::min(k + 1, states_.size() - 1);
    const double step = states_[next].stamp - states_[k].stamp;
    const double share = step > 0.0 ? std::clamp((t - states_[k].stamp) / step, 0.0, 1.0) : 0.0;
    for (std::size_t a = 0; a < 3; ++a)
      position[a].push_back((1.0 - share) * states_[k].position[a] + share * states_[next].position[a]);
  }
  for (std::size_t a = 0; a < 3; ++a) record.add(FORCE_CHANNELS[a]) = std::move(force[a]);
  for (std::size_t a = 0; a < 3; ++a)
    record.add(std::string("axis_") + AXIS_NAMES[a]) = std::move(position[a]);
  record.add("spindle_angle") = std::move(angle);
  record.add("load_meter") = std::move(load);
  return record;
}

}  // namespace smartmill
