#include "smartmill_loadmeter/motor/axis_drive_recorder.h"

#include <algorithm>
#include <string>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

void AxisDriveRecorder::handle(const CuttingCondition& condition) {
  cutting_ = condition.isInWork();
  open_ = false;
}

void AxisDriveRecorder::handle(const SampleBlock& servo) {
  std::array<std::size_t, 3> velocity{}, current{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string v = std::string("axis_v") + AXIS_NAMES[axis],
                      i = std::string("current_") + AXIS_NAMES[axis];
    const auto has = [&servo](const std::string& channel) {
      return std::find(servo.channels.begin(), servo.channels.end(), channel) != servo.channels.end();
    };
    lacks_channels_ = !has(v) || !has(i);
    if (lacks_channels_) return;
    velocity[axis] = servo.channel(v);
    current[axis] = servo.channel(i);
  }
  if (next_index_ && *next_index_ != servo.first_index) open_ = false;
  next_index_ = servo.first_index + servo.size();
  newest_ = servo.timeOf(servo.size());
  if (cutting_) return;
  for (std::size_t k = 0; k < servo.size(); ++k) {
    add({servo.at(k, velocity[0]), servo.at(k, velocity[1]), servo.at(k, velocity[2])},
        {servo.at(k, current[0]), servo.at(k, current[1]), servo.at(k, current[2])}, servo.sample_rate);
  }
  while (moves_.size() > 1 && recorded() > options_.longest) moves_.pop_front();
}

void AxisDriveRecorder::add(const std::array<double, 3>& velocity, const std::array<double, 3>& current,
                            double sample_rate) {
  const bool moves = std::any_of(velocity.begin(), velocity.end(), [](double v) { return v != 0.0; });
  resting_ = moves ? 0.0 : resting_ + 1.0 / sample_rate;
  if (resting_ > options_.rest) {
    open_ = false;
    return;
  }
  if (!open_ || static_cast<double>(moves_.back().size()) >= options_.move * sample_rate) {
    moves_.emplace_back();
    moves_.back().sample_rate = sample_rate;
    open_ = true;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    moves_.back().velocity[axis].push_back(velocity[axis]);
    moves_.back().current[axis].push_back(current[axis]);
  }
}

double AxisDriveRecorder::recorded() const {
  double seconds = 0.0;
  for (const Move& move : moves_) seconds += static_cast<double>(move.size()) / move.sample_rate;
  return seconds;
}

AxisDrive AxisDriveRecorder::identify(std::size_t axis, const AxisDriveOptions& options) const {
  const std::string name = AXIS_NAMES.at(axis);
  if (lacks_channels_) throw Error("daq/servo: expected the channels axis_v" + name + " and current_" + name);
  if (newest_ == 0.0) throw Error("daq/servo: expected a record of Servo Guide, received none");
  std::vector<AxisMotion> motions;
  for (const Move& move : moves_) {
    const std::vector<double>& v = move.velocity[axis];
    const bool is_moving = std::any_of(v.begin(), v.end(), [](double value) { return value != 0.0; });
    const bool is_long = static_cast<double>(v.size()) >= 4.0 * options.smoothing * move.sample_rate;
    if (is_moving && is_long) motions.push_back({move.sample_rate, v, move.current[axis]});
  }
  if (motions.empty()) throw Error("axis drive: axis " + name + " has not moved in air");
  return identifyAxisDrive(motions, options);
}

}  // namespace smartmill::loadmeter
