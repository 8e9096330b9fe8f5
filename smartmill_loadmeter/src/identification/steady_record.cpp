#include "smartmill_loadmeter/identification/steady_record.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/math/running_line.h"
#include "smartmill_core/signal/steady_path.h"

namespace smartmill::loadmeter {

namespace {

/// Progress from one point to another along the steady path, times its length [m2].
double progressAlong(const CuttingCondition& condition, const std::array<double, 3>& a,
                     const std::array<double, 3>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    sum += (b[i] - a[i]) * (condition.steady_to[i] - condition.steady_from[i]);
  return sum;
}

}  // namespace

SteadyRecord::SteadyRecord(const Spindle& spindle, const IdentificationParameters& parameters)
    : spindle_(spindle),
      parameters_(parameters),
      settle_time_(parameters.settle_time_constants * timeConstant(spindle.load_meter_bandwidth)) {
}

void SteadyRecord::begin(const std::optional<CuttingCondition>& condition) {
  clear();
  condition_ = condition;
  unknown_ = 0;
  at_speed_since_.reset();
  on_path_since_.reset();
  path_.clear();
}

void SteadyRecord::clear() {
  readings_.clear();
  motor_.clear();
  force_.clear();
}

void SteadyRecord::reset() {
  begin(std::nullopt);
  last_load_ = last_state_ = 0.0;
}

void SteadyRecord::dropAfter(double stamp, bool with_readings) {
  while (with_readings && !readings_.empty() && readings_.back().stamp > stamp) readings_.pop_back();
  motor_.dropAfter(stamp);
  force_.dropAfter(stamp);
}

bool SteadyRecord::isPresent(const CuttingCondition& condition) const {
  return condition_ && condition_->stamp == condition.stamp && condition_->name == condition.name;
}

void SteadyRecord::handle(const CncState& state) {
  const bool gap = state.stamp - last_state_ > parameters_.maximum_gap;
  last_state_ = state.stamp;
  if (!isTest()) return;
  // In air the tool may be at rest; if it moves, the feed drives show their friction.
  const bool on_path =
      state.connected && state.motion && inSteadyCut(*condition_, state, parameters_.path_tolerance);
  if (on_path_since_ && (!on_path || gap)) {
    dropAfter(state.stamp - parameters_.guard_time, isCut());
    on_path_since_.reset();
  }
  if (!on_path) return;
  PathPoint point{state.stamp, {}};
  if (feedTurns(*condition_)) {
    if (!on_path_since_) on_path_since_ = state.stamp;
    return;
  }
  // onSteadyPath() has found all three.
  for (std::size_t a = 0; a < 3; ++a) point.position[a] = state.position[*controllerAxis(state.axes, a)];
  // The return to the start may run along the path, and the tool is at rest before the path.
  const bool entered = !on_path_since_;
  if (!path_.empty() && (progressAlong(*condition_, path_.back().position, point.position) < 0.0 ||
                         (entered && path_.size() == 1)))
    path_.clear();
  if (path_.empty() && isCut()) clear();
  if (path_.empty() || entered) on_path_since_ = state.stamp;
  path_.push_back(point);
}

// Whether a block of another sensor belongs to the steady part of a test.
bool SteadyRecord::isSteadyAt(double stamp) const {
  if (!isTest()) return false;
  if (!at_speed_since_ || stamp - last_load_ > parameters_.maximum_gap) return false;
  double since = *at_speed_since_;
  // In air without motion only the spindle is measured.
  if (!on_path_since_ && (!path_.empty() || isCut())) return false;
  if (on_path_since_) since = std::max(since, *on_path_since_);
  return stamp >= since + settle_time_;
}

void SteadyRecord::handle(const SampleBlock& block) {
  if (isSteadyAt(block.stamp) && !feedTurns(*condition_)) motor_.add(block);
}

void SteadyRecord::handle(const ForceBlock& block) {
  if (isSteadyAt(block.stamp) && !feedTurns(*condition_)) force_.add(block);
}

SteadyRecord::Reading SteadyRecord::handle(const LoadSample& sample) {
  const bool gap = sample.stamp - last_load_ > parameters_.maximum_gap;
  last_load_ = sample.stamp;
  if (!isTest()) return Reading::ignored;
  const bool known = std::isfinite(sample.spindle_load) && std::isfinite(sample.spindle_speed);
  if (!known) ++unknown_;
  const bool steady = known && std::abs(sample.spindle_speed - condition_->spindle_speed) <=
                                   parameters_.speed_tolerance * condition_->spindle_speed;
  if (at_speed_since_ && (!steady || gap)) {
    dropAfter(sample.stamp - parameters_.guard_time);
    at_speed_since_.reset();
  }
  if (!known) return Reading::unknown;
  if (!steady) return Reading::ignored;
  if (!at_speed_since_) at_speed_since_ = sample.stamp;
  double since = *at_speed_since_;
  if (isCut()) {
    if (!on_path_since_ || sample.stamp - last_state_ > parameters_.maximum_gap) return Reading::ignored;
    since = std::max(since, *on_path_since_);
  }
  if (sample.stamp < since + settle_time_) return Reading::ignored;
  readings_.push_back(
      {sample.stamp, sample.spindle_load * *spindle_.load_meter_full_scale, sample.spindle_speed});
  return Reading::steady;
}

LoadTest SteadyRecord::test(double since) const {
  LoadTest test;
  test.condition = *condition_;
  const auto first =
      std::find_if(readings_.begin(), readings_.end(), [since](const Sample& r) { return r.stamp >= since; });
  const std::vector<Sample> steady(first, readings_.end());
  test.readings = static_cast<int>(steady.size());
  if (test.readings < 2) return test;
  const double n = static_cast<double>(steady.size());
  for (const Sample& r : steady) {
    test.voltages.push_back(r.voltage);
    test.times.push_back(r.stamp - steady.front().stamp);
    test.speed += r.speed / n;
  }
  double speed2 = 0.0;
  for (const Sample& r : steady) speed2 += (r.speed - test.speed) * (r.speed - test.speed);
  test.speed_std = std::sqrt(speed2 / (n * (n - 1.0)));
  test.stamp = steady.back().stamp;
  test.duration = steady.back().stamp - steady.front().stamp;
  test.computeMean(spindle_, resolutionOf(test.voltages, spindle_.load_meter_resolution));
  test.sensor = force_.measurement(since);
  return test;
}

std::array<double, 3> SteadyRecord::velocity() const {
  std::array<double, 3> velocity{{0.0, 0.0, 0.0}};
  // Line of all points: on a busy computer the first or the last state may be stamped late.
  std::array<RunningLine, 3> line;  // [m] over [s]
  for (const PathPoint& point : path_) {
    for (std::size_t a = 0; a < 3; ++a) line[a].add(point.stamp, point.position[a]);
  }
  for (std::size_t a = 0; a < 3; ++a) {
    if (line[a].isDetermined()) velocity[a] = line[a].slope();
  }
  return velocity;
}

}  // namespace smartmill::loadmeter
