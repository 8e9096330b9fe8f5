#include "smartmill_hammer/sequence/hammer_sequence.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <utility>

#include "sequence_detail.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace hammer {
namespace {

/// Sample and state stamps are rounded to nanoseconds; equal times must compare equal however a stream is cut
/// into blocks.
constexpr double SAME_TIME = 1e-6;
/// Orders of M119: 0..4095 (thesis eq. 6.1).
constexpr double COUNTS = 4096.0;
constexpr int MAX_BAD_AVERAGES = 3;
/// [s] for the axes to come to rest after a stop.
constexpr double STOP_TIMEOUT = 10.0;
/// [V] over the range: the tool stands nearer than the sensor can tell; and samples in a row that say so.
constexpr double NEAR_SHARE = 0.98;
constexpr int NEAR_SAMPLES = 8;

int axisIndex(const std::string& name) {
  if (name.size() != 1) return -1;
  const char c = static_cast<char>(std::tolower(static_cast<unsigned char>(name[0])));
  return c >= 'x' && c <= 'z' ? c - 'x' : -1;
}

}  // namespace

std::string moveProgram(const Axes3& from, const std::vector<Waypoint>& path) {
  std::string text = "G91\n";
  Axes3 at = from;
  for (const Waypoint& w : path) {
    std::string block = w.feed > 0.0 ? "G1" : "G0";
    bool moves = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const double distance = (w.position[i] - at[i]) / units::MM;
      if (std::abs(distance) < 0.5e-4) continue;
      block += formatted(" %c%.4f", "XYZ"[i], distance);
      moves = true;
    }
    at = w.position;
    if (!moves) continue;
    if (w.feed > 0.0) block += formatted(" F%.1f", w.feed / units::MM * 60.0);
    text += block + "\n";
  }
  return text + "G90\n";
}

HammerSequence::HammerSequence(const HammerParameters& parameters, const MachineModel& model)
    : parameters_(parameters),
      model_(model),
      station_(model.needHammer("measure the tool tip")),
      tool_(model.needTool("find a flute")),
      approach_(station_, tool_,
                {parameters.sensor_face, parameters.curve_error,
                 parameters.min_gap_share * station_.gap_at_zero_volt, parameters.sensor_electrode}),
      collector_({parameters.trigger_force, parameters.pre_trigger, parameters.record_length}),
      cross_collector_({parameters.trigger_force, parameters.pre_trigger, parameters.record_length}) {
  parameters_.validate();
}

void HammerSequence::reset() {
  stage_ = Stage::idle;
  wait_ = Wait::nothing;
  state_.reset();
  search_.reset();
  calibration_.reset();
  collector_.reset();
  cross_collector_.reset();
  hits_.clear();
  cross_hits_.clear();
  second_hits_.clear();
  commands_.clear();
  feedback_.reset();
  done_.reset();
}

std::vector<Command> HammerSequence::takeCommands() {
  return std::exchange(commands_, {});
}
std::optional<Feedback> HammerSequence::takeFeedback() {
  return std::exchange(feedback_, std::nullopt);
}
std::optional<MeasureFrfResult> HammerSequence::takeResult() {
  return std::exchange(done_, std::nullopt);
}

void HammerSequence::say(const std::string& stage, double progress) {
  feedback_ = Feedback{stage, progress, static_cast<int>(hits_.size() + second_hits_.size())};
}

// ---------------------------------------------------------------------------------------------- goal

bool HammerSequence::handle(const MeasureFrfGoal& goal) {
  if (active()) return false;
  goal_ = goal;
  result_ = MeasureFrfResult();
  hits_.clear();
  cross_hits_.clear();
  second_hits_.clear();
  bad_hits_ = bad_averages_ = near_samples_ = 0;
  search_.reset();
  calibration_.reset();
  sensor_ = cross_sensor_ = second_sensor_ = SensorState();
  has_cross_ = surveyed_ = second_ = false;
  swing_.reset();
  no_cross_.clear();
  no_second_.clear();
  collector_.reset();
  cross_collector_.reset();
  at_station_ = retracting_after_abort_ = false;
  direction_ = axisIndex(goal.direction);
  const int teeth = goal.teeth > 0 ? goal.teeth : tool_.teeth;
  std::string fault;
  if (goal.point != POINT_TOOL_TIP) {
    fault = "point '" + goal.point + "': this node measures " + POINT_TOOL_TIP;
  } else if (station_.position.count(goal.direction) == 0 || direction_ < 0 || direction_ > 1) {
    fault = "direction '" + goal.direction + "': the model's hammer station has no such position";
  } else if (goal.hits < 1 || goal.hits > 1000) {
    fault = "hits " + std::to_string(goal.hits) + ": 1..1000 are due";
  } else if (goal.modes < 0 || goal.modes > 20) {
    fault = "modes " + std::to_string(goal.modes) + ": 0..20 are due";
  } else if (teeth < 1 || teeth > 20) {
    fault = "teeth " + std::to_string(teeth) + ": 1..20 are due";
  } else if (const double struck = station_.offset + parameters_.read_height;
             !(goal.stickout == 0.0 || (goal.stickout > struck && std::isfinite(goal.stickout)))) {
    fault = formatted("stickout %.2f mm: 0 or more than the hammer's offset %.2f mm is due",
                      1e3 * goal.stickout, 1e3 * struck);
  }
  if (!fault.empty()) {
    result_.code = FrfCode::bad_goal;
    result_.message = fault;
    finish();
    return true;
  }
  pitch_ = units::TWO_PI / teeth;
  if (teeth == tool_.teeth) {
    for (const double p : tool_.pitch) pitch_ = std::min(pitch_, p);
  }
  stage_ = Stage::check;
  wait_ = Wait::nothing;
  deadline_ = goal.stamp + parameters_.motion_timeout;
  say("waiting for the controller's state", 0.0);
  return true;
}

Axes3 HammerSequence::stationPosition() const {
  Axes3 p = station_.position.at(goal_.direction);
  for (double& v : p) v = roundTo(v, parameters_.resolution);
  return p;
}

double HammerSequence::safeHeight() const {
  double height = stationPosition()[2] + parameters_.retract_height;
  if (model_.axes && model_.axes->travel[2][1] > model_.axes->travel[2][0]) {
    height = std::min(height, model_.axes->travel[2][1]);
  }
  return roundTo(height, parameters_.resolution);
}

void HammerSequence::start(double now) {
  stage_ = Stage::orient_start;
  say("stopping and orienting the spindle", 0.02);
  orient(now, parameters_.start_angle);
}

// ---------------------------------------------------------------------------------------------- commands

void HammerSequence::send(Command command, Wait wait, double timeout) {
  sent_ = command.stamp;
  deadline_ = command.stamp + timeout;
  wait_ = wait;
  rest_count_ = 0;
  commands_.push_back(std::move(command));
}

void HammerSequence::orient(double now, double angle) {
  Command c;
  c.kind = Command::Kind::orient;
  c.stamp = now;
  const double counts = std::round(angle / units::TWO_PI * COUNTS);
  c.angle = (counts - COUNTS * std::floor(counts / COUNTS)) * units::TWO_PI / COUNTS;
  target_angle_ = c.angle;
  angle_sum_ = 0.0;
  ++result_.spindle_moves;
  send(std::move(c), Wait::angle, parameters_.orient_timeout);
}

void HammerSequence::jog(double now, const std::string& axis, double distance, double feed) {
  Command c;
  c.kind = Command::Kind::jog;
  c.stamp = now;
  c.axis = axis;
  c.distance = distance;
  c.feed = feed;
  // From the commanded place, not from the displayed one, so that the display's rounding does not add up.
  target_[static_cast<std::size_t>(axisIndex(axis))] += distance;
  target_tolerance_ = std::min(parameters_.position_tolerance, 0.25 * std::abs(distance));
  send(std::move(c), Wait::position, parameters_.motion_timeout);
}

void HammerSequence::move(double now, const Axes3& from, std::vector<Waypoint> path) {
  Command c;
  c.kind = Command::Kind::move;
  c.stamp = now;
  c.from = from;
  // In steps that the controller can command.
  Axes3 at = from;
  for (Waypoint& w : path) {
    for (std::size_t i = 0; i < 3; ++i) at[i] += roundTo(w.position[i] - at[i], parameters_.resolution);
    w.position = at;
  }
  target_ = at;
  target_tolerance_ = parameters_.position_tolerance;
  c.path = std::move(path);
  send(std::move(c), Wait::position, parameters_.motion_timeout);
}

void HammerSequence::strike(double now) {
  Command c;
  c.kind = Command::Kind::strike;
  c.stamp = now;
  c.direction = goal_.direction;
  collector_.arm();
  cross_collector_.arm();
  send(std::move(c), Wait::hit, parameters_.strike_timeout);
}

void HammerSequence::average(double from) {
  average_from_ = from;
  average_.clear();
  wait_ = Wait::average;
  deadline_ = from + 1.0;
}

// ---------------------------------------------------------------------------------------------- inputs

bool HammerSequence::late(double now) {
  if (stage_ == Stage::idle || wait_ == Wait::rest || now <= deadline_) return false;
  if (stage_ == Stage::check) {
    result_.code = FrfCode::motion_failed;
    result_.message = state_ ? "the axes are moving" : "no controller state has come";
    finish();
    return true;
  }
  if (stage_ == Stage::stopping || stage_ == Stage::retract) {
    result_.message += stage_ == Stage::stopping ? "; not retracted: the machine does not come to rest"
                                                 : "; not retracted within the time allowed";
    if (result_.code == FrfCode::ok) result_.code = FrfCode::motion_failed;
    finish();
    return true;
  }
  const double waited = now - sent_;
  switch (wait_) {
    case Wait::angle:
      abort(now, FrfCode::motion_failed,
            formatted("the spindle did not come to %.2f deg within %.1f s", units::degFromRad(target_angle_),
                      waited));
      return true;
    case Wait::position:
      abort(now, FrfCode::motion_failed,
            formatted("the axes did not come to their place within %.1f s", waited));
      return true;
    case Wait::average:
      abort(now, FrfCode::bad_data, "no sound voltage of the displacement sensor");
      return true;
    case Wait::hit:
      if (collector_.recording()) return false;
      collector_.disarm();
      cross_collector_.disarm();
      badHit(now, formatted("no hit seen within %.1f s of the command", parameters_.strike_timeout), false);
      return true;
    default:
      return false;
  }
}

std::string HammerSequence::unsafe(const CncState& state) const {
  if (!state.connected) return "the connection to the controller is lost";
  if (state.emergency) return "emergency stop";
  if (state.alarm) return "alarm" + (state.alarm_text.empty() ? std::string() : " " + state.alarm_text);
  if (!state.armed) return "motion is not armed";
  return {};
}

bool HammerSequence::safeToMove() const {
  return state_ && unsafe(*state_).empty();
}

bool HammerSequence::readPosition(const CncState& state, Axes3& position, double& to_go) const {
  bool found[3] = {false, false, false};
  to_go = 0.0;
  for (std::size_t i = 0; i < state.axes.size() && i < state.position.size(); ++i) {
    const int axis = axisIndex(state.axes[i]);
    if (axis < 0) continue;
    position[static_cast<std::size_t>(axis)] = state.position[i];
    found[axis] = true;
    if (i < state.distance_to_go.size()) to_go = std::max(to_go, std::abs(state.distance_to_go[i]));
  }
  return found[0] && found[1] && found[2];
}

void HammerSequence::handle(const CncState& state) {
  state_ = state;
  if (!active()) return;
  const double now = state.stamp;
  const std::string trouble = unsafe(state);
  if (!trouble.empty()) return abort(now, FrfCode::motion_failed, trouble);
  if (stage_ == Stage::check) {
    if (now >= goal_.stamp && !state.motion) return start(now);
    late(now);
    return;
  }
  Axes3 position{};
  double to_go = 0.0;
  if (!readPosition(state, position, to_go)) {
    return abort(now, FrfCode::motion_failed, "cnc/state does not show the axes x, y and z");
  }
  const bool judged = now > sent_ + parameters_.command_delay + SAME_TIME;
  if (judged && wait_ == Wait::position) {
    bool there = !state.motion && to_go <= target_tolerance_;
    for (std::size_t i = 0; i < 3; ++i)
      there = there && std::abs(position[i] - target_[i]) <= target_tolerance_;
    // Twice in a row: distance to go is zero between two blocks too.
    rest_count_ = there ? rest_count_ + 1 : 0;
    if (rest_count_ >= 2) return reached(now);
  } else if (judged && wait_ == Wait::standstill) {
    rest_count_ = !state.motion && to_go == 0.0 ? rest_count_ + 1 : 0;
    if (rest_count_ >= 2) return retract(now);
  }
  late(now);
}

void HammerSequence::handle(const SpindleAngle& angle) {
  if (!active()) return;
  const double now = angle.stamp;
  if (wait_ == Wait::angle && now > sent_ + parameters_.command_delay + SAME_TIME) {
    const double off = nearAngle(angle.angle, target_angle_) - target_angle_;
    if (std::abs(off) <= parameters_.angle_tolerance && std::abs(angle.speed) <= parameters_.zero_speed) {
      angle_sum_ = rest_count_ == 0 ? off : angle_sum_ + off;
      if (++rest_count_ >= parameters_.rest_readings) {
        reached_angle_ = target_angle_ + angle_sum_ / rest_count_;
        return reached(now);
      }
    } else {
      rest_count_ = 0;
    }
  }
  late(now);
}

void HammerSequence::handle(const SampleBlock& block) {
  if (!active()) return;
  std::size_t force_channel = 0, gap_channel = 0;
  try {
    force_channel = block.channel("hammer");
    gap_channel = block.channel("gap");
  } catch (const Error& error) {
    return abort(block.stamp, FrfCode::bad_data, error.what());
  }
  const auto cross = std::find(block.channels.begin(), block.channels.end(), "gap_cross");
  has_cross_ = parameters_.cross_frf != 0 && cross != block.channels.end();
  const auto cross_channel = static_cast<std::size_t>(cross - block.channels.begin());
  for (std::size_t i = 0; i < block.size() && active(); ++i) {
    const double t = block.timeOf(i);
    if (t < goal_.stamp - SAME_TIME) continue;
    const std::uint64_t index = block.first_index + i;
    const double force = block.at(i, force_channel);
    const double volt = block.at(i, stage_ == Stage::calibrate_cross ? cross_channel : gap_channel);
    auto record = collector_.add(t, index, block.sample_rate, force, volt);
    std::optional<HitCollector::Record> beside;
    if (has_cross_) {
      beside = cross_collector_.add(t, index, block.sample_rate, force, block.at(i, cross_channel));
    }
    if (tooNear(volt)) {
      abort(t, FrfCode::no_flute,
            formatted("the tool is too near to the sensor: %.2f V is the end of its range", volt));
    } else if (record && wait_ == Wait::hit) {
      recorded(t, std::move(*record), std::move(beside));
    } else if (wait_ == Wait::rest && t >= rest_until_ - SAME_TIME) {
      strike(t);
    } else if (wait_ == Wait::average && t >= average_from_ - SAME_TIME) {
      const bool gap = !average_.empty() && index != average_index_ + 1;
      average_index_ = index;
      if (gap || !std::isfinite(volt)) {
        average_.clear();
        if (++bad_averages_ > MAX_BAD_AVERAGES) {
          abort(t, FrfCode::bad_data,
                gap ? "daq/hammer loses samples"
                    : "daq/hammer: sample " + std::to_string(index) + " of gap is not a number");
        }
        continue;
      }
      average_.push_back(volt);
      const auto due =
          static_cast<std::size_t>(std::max(2L, std::lround(parameters_.averaging_time * block.sample_rate)));
      if (average_.size() >= due) {
        const std::vector<double> values = std::exchange(average_, {});
        wait_ = Wait::nothing;
        measured(t, mean(values), standardDeviation(values) / std::sqrt(static_cast<double>(values.size())));
      }
    }
  }
  if (active() && block.size() > 0) late(block.timeOf(block.size() - 1));
}

/// On the way to the station and while the spindle turns before it.
bool HammerSequence::tooNear(double volt) {
  const bool watched = at_station_ && (stage_ == Stage::to_station || stage_ == Stage::search_low ||
                                       stage_ == Stage::to_height || stage_ == Stage::search_high ||
                                       stage_ == Stage::to_second || stage_ == Stage::orient_second);
  near_samples_ = watched && volt >= NEAR_SHARE * station_.range_volt ? near_samples_ + 1 : 0;
  return near_samples_ >= NEAR_SAMPLES;
}

// ---------------------------------------------------------------------------------------------- ends

void HammerSequence::cancel(double stamp) {
  if (active() && stage_ != Stage::retract && stage_ != Stage::stopping)
    abort(stamp, FrfCode::cancelled, "cancelled");
}

void HammerSequence::commandFailed(double stamp, const std::string& text) {
  if (!active()) return;
  abort(stamp, wait_ == Wait::hit ? FrfCode::no_hit : FrfCode::motion_failed, text);
}

void HammerSequence::lost(double stamp, const std::string& text) {
  if (!active()) return;
  if (stage_ != Stage::stopping && stage_ != Stage::retract) {
    const bool moving = at_station_ && safeToMove();
    abort(stamp, FrfCode::bad_data, text);
    if (!active()) return;
    if (moving) retract(stamp);
    result_.message += "; a retract was sent, unseen";
  } else {
    if (result_.code == FrfCode::ok) result_.code = FrfCode::bad_data;
    result_.message += "; " + text + " during the retract";
  }
  finish();
}

void HammerSequence::abort(double now, FrfCode code, const std::string& why) {
  if (!active()) return;
  collector_.disarm();
  cross_collector_.disarm();
  if (stage_ == Stage::stopping || stage_ == Stage::retract) {
    // Already on the way out: what failed is the retract.
    if (result_.code == FrfCode::ok) result_.code = code;
    result_.message += "; not retracted: " + why;
    return finish();
  }
  result_.code = code;
  result_.message = why;
  const bool commanded = stage_ != Stage::check;
  if (commanded) {
    Command stop;
    stop.kind = Command::Kind::stop;
    stop.stamp = now;
    send(std::move(stop), Wait::standstill, STOP_TIMEOUT);
  }
  if (!at_station_) return finish();
  if (!safeToMove()) {
    result_.message += "; the tool stays at the station, retract it by hand";
    return finish();
  }
  stage_ = Stage::stopping;
  say("stopping: " + why, 0.95);
}

void HammerSequence::retract(double now) {
  stage_ = Stage::retract;
  say("retracting from the station", 0.97);
  Axes3 here{};
  double to_go = 0.0;
  readPosition(*state_, here, to_go);
  const auto d = static_cast<std::size_t>(direction_);
  // Away from a second sensor first: sideways another part of the tool would pass it.
  Axes3 off = here;
  off[1 - d] = roundTo(std::min(here[1 - d], stationPosition()[1 - d]), parameters_.resolution);
  Axes3 beside = off;
  // Away from the sensor only, never towards it.
  beside[d] = roundTo(std::min(here[d], stationPosition()[d] - parameters_.standoff), parameters_.resolution);
  Axes3 up = beside;
  up[2] = std::max(here[2], safeHeight());
  move(now, here, {{off, parameters_.approach_feed}, {beside, parameters_.approach_feed}, {up, 0.0}});
}

void HammerSequence::finish() {
  stage_ = Stage::idle;
  wait_ = Wait::nothing;
  collector_.disarm();
  cross_collector_.disarm();
  done_ = std::move(result_);
  result_ = MeasureFrfResult();
}

}  // namespace hammer
}  // namespace smartmill
