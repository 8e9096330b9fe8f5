#include "recordings/bag_cuts.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/signal/unwrapped_angle.h"
#include "smartmill_kalman/sensor/spindle_force_sensor.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::kalman {
namespace {

/// Consecutive samples of three channels.
struct Stream {
  double stamp = 0.0, rate = 0.0;  // [s] of the first, [Hz]
  std::array<std::vector<double>, 3> value;

  /// Appends samples; another rate or a gap starts anew.
  void add(double begin, double sample_rate, const std::array<std::vector<double>, 3>& values) {
    const double expected = stamp + static_cast<double>(value[0].size()) / std::max(rate, 1.0);
    if (value[0].empty() || sample_rate != rate || std::abs(begin - expected) > 0.5 / sample_rate) {
      for (auto& v : value) v.clear();
      stamp = begin;
      rate = sample_rate;
    }
    for (std::size_t a = 0; a < 3; ++a) value[a].insert(value[a].end(), values[a].begin(), values[a].end());
  }
  double end() const { return stamp + static_cast<double>(value[0].size()) / rate; }
};

class CutCollector {
 public:
  CutCollector(const BagCutsRequest& request, BagCuts& found) : request_(request), found_(found) {
    if (!request.spindle_sensor.empty())
      spindle_.emplace(readSpindleSensor(request.spindle_sensor), request.length);
  }

  void push(const CuttingCondition& condition) {
    close();
    if (spindle_) spindle_->handle(condition);
    condition_ = condition;
  }
  void push(const CncState& state) {
    const bool gap = state.stamp - last_state_ > request_.maximum_gap;
    last_state_ = state.stamp;
    const bool on_line = cutting() && state.connected && state.feed > 0.0 &&
                         onSteadyPath(*condition_, state, request_.path_tolerance);
    if (!on_line || (gap && from_)) {
      if (from_ && !to_closed_) to_closed_ = true;  // the first steady run counts
      return;
    }
    if (to_closed_) return;
    if (!from_) from_ = state.stamp;
    to_ = state.stamp;
  }
  void push(const SpindleAngle& angle) {
    if (std::isnan(angle.angle)) return;  // at rest
    if (spindle_) spindle_->handle(angle);
    if (!cutting()) return;
    if (angles_.empty()) angles_.push_back({angle.stamp, angle.angle, angle.angle});
    if (angle.stamp > angles_.back().time) angles_.push_back(angles_.back().next(angle));
  }
  void push(const ForceBlock& block) {
    if (cutting() && block.isCompensated()) force_.add(block.stamp, block.sample_rate, block.force);
  }
  void push(const SampleBlock& raw) {
    const bool six = SpindleForceSensor::isSixChannels(raw);
    if (six && !spindle_)
      throw Error(request_.path + ": " + request_.response +
                  ": six sensors in the spindle, expected a calibration (--spindle-sensor)");
    const SampleBlock block = six ? spindle_->handle(raw) : raw;
    if (!cutting()) return;
    std::array<std::vector<double>, 3> values;
    if (request_.tool) {
      values[0] = block.column("x");
      values[1] = block.column("y");
      values[2].assign(values[0].size(), 0.0);
    } else {
      values = {block.column("fx"), block.column("fy"), block.column("fz")};
    }
    response_.add(block.stamp, block.sample_rate, values);
  }
  void push(const MeasuredModes& modes) {
    if (modes.point != (request_.tool ? POINT_TOOL_TIP : POINT_FORCE_SENSOR)) return;
    if (const auto axis = axisIndex(modes.direction)) found_.rest[*axis] = modes.model;
  }
  void close() {
    if (cutting() && from_ && !force_.value[0].empty() && !response_.value[0].empty() && angles_.size() > 1)
      cut();
    from_.reset();
    to_ = 0.0;
    to_closed_ = false;
    angles_.clear();
    force_ = response_ = {};
  }

 private:
  bool cutting() const { return condition_ && condition_->kind == CuttingCondition::Kind::cut; }

  void cut() {
    const std::string where = request_.path + ": cut '" + condition_->name + "': ";
    if (force_.rate != response_.rate)
      throw Error(where + formatted("%s at %.0f Hz, force/compensated at %.0f Hz", request_.response.c_str(),
                                    response_.rate, force_.rate));
    const double apart = (response_.stamp - force_.stamp) * force_.rate, whole = std::round(apart);
    if (std::abs(apart - whole) > request_.together)
      throw Error(where + formatted("force/compensated and %s are %.2f samples apart, not sampled together",
                                    request_.response.c_str(), apart - whole));
    const double begin =
        std::max({*from_ + request_.settling, force_.stamp, response_.stamp, angles_.front().time});
    const double end =
        std::min({to_ - request_.settling, force_.end(), response_.end(), angles_.back().time});
    if (!(end > begin)) return;
    CutSegment one;
    one.name = condition_->name;
    one.sample_rate = force_.rate;
    one.relative_force_std = request_.force_error;
    const auto first = static_cast<std::size_t>(std::ceil((begin - force_.stamp) * force_.rate));
    const auto last = static_cast<std::size_t>(std::floor((end - force_.stamp) * force_.rate));
    std::size_t at = 1;
    for (std::size_t i = first; i < last; ++i) {
      const double time = force_.stamp + static_cast<double>(i) / force_.rate;
      while (at + 1 < angles_.size() && angles_[at].time < time) ++at;
      one.angle.push_back(std::fmod(angles_[at - 1].between(angles_[at], time), units::TWO_PI));
    }
    one.speed =
        (angles_.back().turned - angles_.front().turned) / (angles_.back().time - angles_.front().time);
    for (std::size_t a = 0; a < 3; ++a) {
      one.force.clear();
      one.response.clear();
      for (std::size_t i = first; i < last; ++i) {
        one.force.push_back(force_.value[a][i]);
        const auto k = static_cast<std::ptrdiff_t>(i) - static_cast<std::ptrdiff_t>(whole);
        one.response.push_back(response_.value[a][static_cast<std::size_t>(k)]);
      }
      found_.axis[a].push_back(one);
    }
  }

  const BagCutsRequest& request_;
  BagCuts& found_;
  std::optional<SpindleForceSensor> spindle_;
  std::optional<CuttingCondition> condition_;
  std::optional<double> from_;  // [s] steady since
  double to_ = 0.0, last_state_ = 0.0;
  bool to_closed_ = false;
  std::deque<UnwrappedAngle> angles_;
  Stream force_, response_;
};

}  // namespace

BagCuts cutsOfBag(const BagCutsRequest& request, const std::function<void(double)>& progress) {
  BagCuts found;
  CutCollector collector(request, found);
  RecordingReader bag(request.path);
  for (const std::string& topic :
       {std::string(names::FORCE_COMPENSATED), std::string(names::SPINDLE_ANGLE), request.response}) {
    if (!bag.has(topic)) throw Error(request.path + ": topic " + topic + " not found");
  }
  feed<CuttingCondition>(bag, names::CUTTING_CONDITION, collector);
  feed<CncState>(bag, names::CNC_STATE, collector);
  feed<SpindleAngle>(bag, names::SPINDLE_ANGLE, collector);
  feed<ForceBlock>(bag, names::FORCE_COMPENSATED, collector);
  feed<SampleBlock>(bag, request.response, collector);
  feed<MeasuredModes>(bag, names::TOOL_MODES, collector);
  bag.run(progress);
  collector.close();
  return found;
}

}  // namespace smartmill::kalman
