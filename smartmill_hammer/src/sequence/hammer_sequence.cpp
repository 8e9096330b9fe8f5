#include "smartmill_hammer/sequence/hammer_sequence.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/hit_judge.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/coil_talk.h"

namespace smartmill {
namespace hammer {
namespace {

constexpr const char* AXIS_NAMES[] = {"x", "y", "z"};
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
/// Of the first search's step: the helix tells the second where to begin.
constexpr double SECOND_STEP = 0.5;
/// Of a depth read from the sensor's nominal curve, which a round and fluted tool does not quite follow.
constexpr double TRUSTED_DEPTH = 1.0;
constexpr int FACE_STEPS = 24;
/// Of the trial blow's swing: no later one's is larger.
constexpr double LARGEST_SWING = 1.5;
/// Two tips of a fit band: share of the sensor's range that counts as its end.
constexpr double RANGE_SHARE = 0.98;
/// Hits at the second height, at least; [m] of tool left above it; [1] of the gap at zero volt by which a
/// flank seen from the same place may be nearer.
constexpr int SECOND_HITS = 3;
constexpr double LEAST_SHANK = 4e-3;
/// Of the hammer's offset: less tells nothing.
constexpr double LEAST_LOWERED = 0.15;
constexpr double SAME_FLANK = 0.1;

int axisIndex(const std::string& name) {
  if (name.size() != 1) return -1;
  const char c = static_cast<char>(std::tolower(static_cast<unsigned char>(name[0])));
  return c >= 'x' && c <= 'z' ? c - 'x' : -1;
}

double roundTo(double value, double step) {
  return std::round(value / step) * step;
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

// ---------------------------------------------------------------------------------------------- steps

FluteSearchOptions HammerSequence::searchOptions() const {
  FluteSearchOptions options = FluteSearchOptions::forPitch(pitch_);
  const double scale = options.first_step / FluteSearchOptions().first_step;
  options.first_step = scale * parameters_.bracket_first_step;
  options.max_step = std::max(options.first_step, std::min(parameters_.bracket_max_step, 0.25 * pitch_));
  options.tolerance = scale * parameters_.flute_tolerance;
  options.range_volt = station_.range_volt;
  options.noise_sigmas = parameters_.noise_sigmas;
  options.least_rise = parameters_.least_rise;
  options.golden_only = parameters_.golden_only != 0;
  if (stage_ == Stage::search_high && !options.golden_only) options.first_step *= SECOND_STEP;
  return options;
}

void HammerSequence::moveToStation(double now) {
  const Axes3 station = stationPosition();
  Axes3 here{};
  double to_go = 0.0;
  readPosition(*state_, here, to_go);
  Axes3 above = station;
  above[static_cast<std::size_t>(direction_)] -= parameters_.standoff;
  above[2] = std::max(safeHeight(), here[2]);
  Axes3 up = here, beside = above;
  up[2] = above[2];
  beside[2] = station[2];
  Axes3 near = station;
  near[static_cast<std::size_t>(direction_)] -= parameters_.near_path;
  at_station_ = true;
  move(now, here,
       {{up, 0.0},
        {above, 0.0},
        {beside, parameters_.approach_feed},
        {near, parameters_.approach_feed},
        {station, parameters_.jog_feed}});
}

void HammerSequence::reached(double now) {
  wait_ = Wait::nothing;
  switch (stage_) {
    case Stage::orient_start:
      stage_ = Stage::to_station;
      say("moving to the hammer station " + goal_.direction, 0.05);
      return moveToStation(now);
    case Stage::to_station:
      stage_ = Stage::search_low;
      say("searching a flute at the tip", 0.1);
      search_.emplace(parameters_.start_angle, searchOptions());
      return orient(now, search_->next());
    case Stage::search_low:
    case Stage::search_high:
    case Stage::survey:
    case Stage::calibrate:
    case Stage::calibrate_cross:
    case Stage::calibrate_again:
    case Stage::calibrate_second:
      return average(now + parameters_.settle_time);
    case Stage::to_second:
      stage_ = Stage::orient_second;
      say("turning the flute to the hammer at the second height", 0.84);
      // As far beyond the hammer's first height as that is above the tip's search, at the same helix.
      return orient(now, result_.flute_low + (result_.flute_hammer - result_.flute_low) *
                                                 (1.0 + lowered() / station_.offset));
    case Stage::orient_second:
      stage_ = Stage::calibrate_second;
      say("calibrating the displacement sensor at the second height", 0.85);
      return average(now + parameters_.settle_time);
    case Stage::to_height:
      stage_ = Stage::search_high;
      say("searching the flute halfway up to the hammer", 0.3);
      // A right-hand helix lags with height: the spindle must turn on by the lag.
      expected_angle_ = result_.flute_low + tool_.lag() * 0.5 * station_.offset;
      search_.emplace(expected_angle_, searchOptions());
      return orient(now, search_->next());
    case Stage::to_tip:
      stage_ = Stage::orient_flute;
      say("turning the flute to the hammer", 0.5);
      return orient(now, result_.flute_hammer);
    case Stage::orient_flute:
      stage_ = Stage::calibrate;
      say("calibrating the displacement sensor", surveyed_ ? 0.58 : 0.55);
      return average(now + parameters_.settle_time);
    case Stage::retract:
      return finish();
    default:
      return;
  }
}

/// The axis along which the sensor now calibrated looks.
std::size_t HammerSequence::calibratedAxis() const {
  const auto along = static_cast<std::size_t>(direction_);
  return stage_ == Stage::calibrate_cross ? 1 - along : along;
}

void HammerSequence::keepProfile() {
  profile_.clear();
  flute_volt_ = search_->volt();
  flute_gap_ = std::min(2.0 * station_.gap_at_zero_volt, nominalGap(flute_volt_));
  for (const FluteSearch::Reading& r : search_->readings())
    profile_.push_back({nearAngle(r.angle, result_.flute_low) - result_.flute_low, retreatOf(r.volt, 0.0)});
}

double HammerSequence::nominalGap(double volt) const {
  return station_.gap_at_zero_volt / std::max(0.02, 1.0 + volt / station_.gain_volt);
}

/// [m] behind a flute at the sensor, of a reading so much nearer than the station.
double HammerSequence::retreatOf(double volt, double moved) const {
  const double depth = nominalGap(volt) + moved - nominalGap(flute_volt_);
  return TRUSTED_DEPTH * std::clamp(depth, 0.0, station_.flute_depth);
}

/// What a sensor sees with the flute at the hammer belongs to the flanks of the flutes on either side. Of
/// uneven teeth any may be the flute that was found: as far from them as the tool allows, which says least.
/// @param further [rad] that the spindle has turned on from there
void HammerSequence::addToProfile(std::size_t axis, double further, double volt) {
  const double off = turnedFrom(axis) + further, moved = target_[axis] - stationPosition()[axis];
  double ahead = 0.0, behind = 0.0;
  for (int found = 0; found < tool_.teeth; ++found) {
    double next = units::TWO_PI, last = -units::TWO_PI;
    for (int tooth = 0; tooth < tool_.teeth; ++tooth) {
      const double turned = turnedFromTooth(off, tooth, found);
      if (turned >= 0.0) next = std::min(next, turned);
      if (turned <= 0.0) last = std::max(last, turned);
    }
    if (next < units::TWO_PI) ahead = std::max(ahead, next);
    if (last > -units::TWO_PI) behind = std::min(behind, last);
  }
  for (const double place : {ahead, behind}) {
    if (place != 0.0) profile_.push_back({place, retreatOf(volt, moved)});
  }
}

/// [rad] from a tooth, of a place so far from the flute that was found, were that the tooth `found`.
double HammerSequence::turnedFromTooth(double off, int tooth, int found) const {
  return std::remainder(off - tool_.toothAngle(tooth) + tool_.toothAngle(found), units::TWO_PI);
}

/// [rad] that the spindle, a flute at the hammer, stands from a flute at the sensor of an axis.
double HammerSequence::turnedFrom(std::size_t axis) const {
  const double across = axis == static_cast<std::size_t>(direction_) ? 0.0
                        : axis == 0                                  ? 0.5 * units::PI
                                                                     : -0.5 * units::PI;
  return result_.flute_hammer - result_.flute_low - across;
}

/// [m] at least, of the surface that the sensor would see with the spindle so far from a flute. The root of
/// the depth runs straight between two readings, which lies below a flank that is round or straight; beyond
/// the last reading the surface falls towards the gullet. Of uneven teeth any may be the flute that was
/// found.
double HammerSequence::leastRetreat(double off) const {
  double least = station_.flute_depth;
  const int teeth = tool_.teeth;
  for (int k = 0; k < teeth * teeth; ++k) {
    const double turned = turnedFromTooth(off, k / teeth, k % teeth);
    const double sense = turned < 0.0 ? -1.0 : 1.0, at = sense * turned;
    Retreat below, above{std::numeric_limits<double>::infinity(), 0.0};
    for (const Retreat& r : profile_) {
      const double place = sense * r.off;
      if (place > below.off && place <= at) below = {place, r.depth};
      if (place > at && place < above.off) above = {place, r.depth};
    }
    double depth = below.depth;
    if (std::isfinite(above.off) && above.depth > below.depth) {
      const double share = (at - below.off) / (above.off - below.off);
      const double root = std::sqrt(below.depth) + share * (std::sqrt(above.depth) - std::sqrt(below.depth));
      depth = root * root;
    }
    least = std::min(least, depth);
  }
  return least;
}

/// [m] towards the sensor until the tool would be as near to its face as allowed. At the station a flute that
/// points at the sensor leaves about twice the gap at zero volt; now the spindle stands as it does for the
/// hammer, and what is foremost before the face follows from the first search.
double HammerSequence::safeTravel(std::size_t axis) const {
  const double turned = turnedFrom(axis), radius = tool_.radius();
  const double widest = std::asin(std::min(0.9, 0.5 * parameters_.sensor_face / radius));
  double behind = 2.0 * radius;
  for (int k = -FACE_STEPS; k <= FACE_STEPS; ++k) {
    const double a = widest * k / FACE_STEPS;
    behind = std::min(behind, radius * (1.0 - std::cos(a)) + leastRetreat(turned - a) * std::cos(a));
  }
  const double moved = target_[axis] - stationPosition()[axis];
  return flute_gap_ - parameters_.min_gap_share * station_.gap_at_zero_volt + behind - moved -
         swing_.value_or(0.0);
}

SensorCalibrationOptions HammerSequence::calibrationOptions(std::size_t axis) const {
  SensorCalibrationOptions o;
  o.first_jog = parameters_.first_jog;
  o.max_jog = parameters_.max_jog;
  o.least_jog = parameters_.least_jog;
  o.resolution = parameters_.resolution;
  o.zero_volt = parameters_.zero_volt;
  o.check_jog = parameters_.check_jog;
  o.position_std = parameters_.position_std;
  o.range_volt = station_.range_volt;
  o.gain_volt = station_.gain_volt;
  o.gap_at_zero_volt = station_.gap_at_zero_volt;
  o.min_gap = parameters_.min_gap_share * station_.gap_at_zero_volt;
  o.swing = swing_.value_or(0.0);
  // The flute faces the hammer, so the sensor may look between two flutes.
  o.max_travel = parameters_.max_approach + station_.flute_depth;
  o.safe_travel = safeTravel(axis);
  return o;
}

void HammerSequence::measured(double now, double volt, double volt_std) {
  if (stage_ == Stage::calibrate || stage_ == Stage::calibrate_cross || stage_ == Stage::calibrate_again ||
      stage_ == Stage::calibrate_second) {
    return calibrated(now, volt, volt_std);
  }
  if (stage_ == Stage::survey) return surveyed(now, volt);
  search_->give(reached_angle_, volt, volt_std);
  if (search_->state() == FluteSearch::State::searching) return orient(now, search_->next());
  if (search_->state() == FluteSearch::State::no_flute) {
    return abort(now, FrfCode::no_flute, search_->reason());
  }
  if (search_->volt() > RANGE_SHARE * station_.range_volt) {
    return abort(
        now, FrfCode::no_flute,
        formatted("the flute is too near to the sensor: %.2f V is the end of its range", search_->volt()));
  }
  fluteFound(now);
}

/// Whether what is known of the flanks would hold the tool back before the sensor is zeroed: then two more
/// readings to either side, from the station's safe distance.
bool HammerSequence::surveyDue(double volt) {
  if (std::exchange(surveyed_, true)) return false;
  const auto along = static_cast<std::size_t>(direction_);
  const double due = nominalGap(volt) - station_.gap_at_zero_volt + parameters_.check_jog;
  if (safeTravel(along) >= due) return false;
  const double beside = 0.5 * std::asin(std::min(0.9, 0.5 * parameters_.sensor_face / tool_.radius()));
  survey_ = {beside, -beside};
  return true;
}

/// How far a blow lets the tool swing towards the sensor, by the sensor's nominal curve, which far from it
/// and before a flank tells rather too much.
void HammerSequence::tried(double now, const Hit& hit) {
  const auto before =
      hit.response.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(1, hit.pre_trigger / 2));
  const double rest = mean({hit.response.begin(), before});
  const double top = *std::max_element(hit.response.begin(), hit.response.end());
  const double noise = 3.0 * standardDeviation({hit.response.begin(), before});
  swing_ = LARGEST_SWING * std::max(0.0, nominalGap(rest) - nominalGap(std::max(rest, top - noise)));
  swing_ = std::min(*swing_, station_.gap_at_zero_volt);
  stage_ = Stage::calibrate;
  say(formatted("a blow swings the tool by %.0f um at most towards the sensor", 1e6 * *swing_), 0.6);
  average(now + parameters_.rest_time);
}

void HammerSequence::surveyed(double now, double volt) {
  addToProfile(static_cast<std::size_t>(direction_), survey_.back(), volt);
  survey_.pop_back();
  if (!survey_.empty()) return orient(now, result_.flute_hammer + survey_.back());
  stage_ = Stage::orient_flute;
  orient(now, result_.flute_hammer);
}

void HammerSequence::calibrated(double now, double volt, double volt_std) {
  if (!calibration_) {
    if (stage_ == Stage::calibrate) flank_volt_ = volt;
    // Seen from the same place, nearer than at the tip: the flutes end here, or run otherwise. Then nothing
    // is known of the flanks, and the tool counts as round.
    if (stage_ == Stage::calibrate_second &&
        nominalGap(volt) < nominalGap(flank_volt_) - SAME_FLANK * station_.gap_at_zero_volt)
      profile_.clear();
    if (stage_ != Stage::calibrate_again) addToProfile(calibratedAxis(), 0.0, volt);
    if (stage_ == Stage::calibrate && surveyDue(volt)) {
      stage_ = Stage::survey;
      say("looking at the flanks that the sensor's face will meet", 0.56);
      return orient(now, result_.flute_hammer + survey_.back());
    }
    if (stage_ == Stage::calibrate && !swing_) {
      stage_ = Stage::trial;
      say("a trial blow, before the tool nears the sensor", 0.59);
      return strike(now);
    }
    calibration_.emplace(calibrationOptions(calibratedAxis()));
    calibration_->start(volt, volt_std);
  } else {
    calibration_->give(volt, volt_std);
  }
  switch (calibration_->state()) {
    case SensorCalibration::State::jogging:
      return jog(now, AXIS_NAMES[calibratedAxis()], calibration_->next(), parameters_.jog_feed);
    case SensorCalibration::State::failed:
      if (stage_ == Stage::calibrate_cross) return crossFailed(now);
      if (stage_ == Stage::calibrate_second)
        return withoutSecond(now, "sensor calibration: " + calibration_->reason());
      return abort(now, FrfCode::bad_data, "sensor calibration: " + calibration_->reason());
    case SensorCalibration::State::done:
      return sensorKnown(now);
  }
}

/// With a second sensor the first is done again: the second's jogs have moved the round tool before it.
void HammerSequence::sensorKnown(double now) {
  SensorState& sensor = stage_ == Stage::calibrate_cross    ? cross_sensor_
                        : stage_ == Stage::calibrate_second ? second_sensor_
                                                            : sensor_;
  sensor = {calibration_->sensitivity(), calibration_->sensitivityStd(), calibration_->bendGap(),
            calibration_->bendGapStd(), calibration_->volt()};
  const bool held_back = calibration_->heldBack();
  calibration_.reset();
  say(formatted("sensor calibrated: %.3f +- %.3f um/V", 1e6 * sensor.sensitivity,
                1e6 * sensor.sensitivity_std) +
          (held_back ? formatted(" at %.2f V, held back by the tool's edges", sensor.volt) : std::string()),
      stage_ == Stage::calibrate         ? 0.62
      : stage_ == Stage::calibrate_cross ? 0.66
      : stage_ == Stage::calibrate_again ? 0.7
                                         : 0.87);
  if (stage_ == Stage::calibrate && has_cross_) {
    stage_ = Stage::calibrate_cross;
    return average(now + parameters_.settle_time);
  }
  if (stage_ == Stage::calibrate_cross) {
    stage_ = Stage::calibrate_again;
    return average(now + parameters_.settle_time);
  }
  if (stage_ != Stage::calibrate_second) {
    result_.sensitivity = sensor_.sensitivity;
    result_.sensitivity_std = sensor_.sensitivity_std;
  }
  stage_ = Stage::strike;
  strike(now);
}

void HammerSequence::crossFailed(double now) {
  no_cross_ = calibration_->reason();
  calibration_.reset();
  stage_ = Stage::calibrate_again;
  say("no cross FRF: " + no_cross_, 0.66);
  average(now + parameters_.settle_time);
}

void HammerSequence::fluteFound(double now) {
  const double half = roundTo(0.5 * station_.offset, parameters_.resolution);
  if (stage_ == Stage::search_low) {
    result_.flute_low = search_->angle();
    result_.flute_sure = search_->sure();
    keepProfile();
    stage_ = Stage::to_height;
    say("lowering the tool to find the flute halfway up to the hammer", 0.28);
    return jog(now, "z", -half, parameters_.approach_feed);
  }
  // Another flute may have been nearer to the walk: the one meant is within half a pitch of where the helix
  // puts it.
  result_.flute_high = search_->angle();
  result_.flute_sure *= search_->sure();
  const double full_pitch = units::TWO_PI / (goal_.teeth > 0 ? goal_.teeth : tool_.teeth);
  result_.flute_high -= full_pitch * std::round((result_.flute_high - expected_angle_) / full_pitch);
  result_.flute_hammer = 2.0 * result_.flute_high - result_.flute_low;  // eq. 4.1
  stage_ = Stage::to_tip;
  say(formatted("flute at %.2f deg at the tip, %.2f deg halfway up, %.2f deg at the hammer",
                units::degFromRad(result_.flute_low), units::degFromRad(result_.flute_high),
                units::degFromRad(result_.flute_hammer)) +
          formatted(", sure by %.1f %%, %d spindle moves", 100.0 * result_.flute_sure, result_.spindle_moves),
      0.48);
  jog(now, "z", half, parameters_.approach_feed);
}

// Of a trial blow only the blow counts: the tool stands too far from the sensor for its answer to be judged.
HitFault HammerSequence::judged(const Hit& hit) const {
  HitJudgeOptions options{parameters_.weak_force, parameters_.second_hit_share,
                          RANGE_SHARE * station_.range_volt, parameters_.force_high};
  if (stage_ != Stage::trial) return hitFault(hit, options);
  Hit blow = hit;
  blow.response = blow.force;
  options.response_range = 0.0;
  return hitFault(blow, options);
}

void HammerSequence::recorded(double now, HitCollector::Record record,
                              std::optional<HitCollector::Record> cross) {
  removeCoilTalk(record.hit, parameters_.coil_share);
  if (cross) removeCoilTalk(cross->hit, parameters_.coil_share);
  HitFault fault{record.fault, true};
  if (fault.text.empty() && cross) fault.text = cross->fault;
  if (fault.text.empty()) fault = judged(record.hit);
  if (!fault.text.empty()) return badHit(now, fault.text, fault.bad_data);
  if (stage_ == Stage::trial) return tried(now, record.hit);
  std::vector<Hit>& hits = second_ ? second_hits_ : hits_;
  hits.push_back(std::move(record.hit));
  if (cross && !second_) cross_hits_.push_back(std::move(cross->hit));
  const std::vector<HitFault> beside = faultsBeside(hits, std::vector<bool>(hits.size(), true));
  for (std::size_t h = 0; h < hits.size(); ++h) {
    if (beside[h].text.empty()) continue;
    hits.erase(hits.begin() + static_cast<std::ptrdiff_t>(h));
    if (!second_ && h < cross_hits_.size())
      cross_hits_.erase(cross_hits_.begin() + static_cast<std::ptrdiff_t>(h));
    return badHit(now, beside[h].text, beside[h].bad_data);
  }
  say("hit " + std::to_string(hits.size()) + " of " + std::to_string(hitsDue()), hitProgress());
  if (static_cast<int>(hits.size()) >= hitsDue() || enough()) return hitsDone(now);
  wait_ = Wait::rest;
  rest_until_ = now + parameters_.rest_time;
}

/// [1] with a second height the first one's hits end at 0.83.
double HammerSequence::hitProgress() const {
  const double from = second_ ? 0.87 : 0.7, to = second_ || !secondHeightDue() ? 0.95 : 0.83;
  const std::size_t hits = second_ ? second_hits_.size() : hits_.size();
  return from + (to - from) * static_cast<double>(hits) / hitsDue();
}

/// At the second height half as many: only the ratio to the first counts.
int HammerSequence::hitsDue() const {
  return second_ ? std::min(goal_.hits, std::max(SECOND_HITS, (goal_.hits + 1) / 2)) : goal_.hits;
}

void HammerSequence::hitsDone(double now) {
  if (!second_ && secondHeightDue()) return toSecondHeight(now);
  evaluate();
  retract(now);
}

/// [m] by which the tool is lowered for the second height: no further than the search of the flute has been,
/// and the hammer still meets the tool.
double HammerSequence::lowered() const {
  const double room = goal_.stickout - station_.offset - parameters_.read_height - LEAST_SHANK;
  return roundTo(std::min(0.5 * station_.offset, room), parameters_.resolution);
}

bool HammerSequence::correctsApart() const {
  return parameters_.tip_correction == "apart" && goal_.stickout > 0.0 && station_.offset > 0.0;
}

bool HammerSequence::secondHeightDue() const {
  return correctsApart() && parameters_.second_height != 0 && lowered() > LEAST_LOWERED * station_.offset;
}

/// First back to the station's distance, where nothing of the tool can reach the sensor; then down.
void HammerSequence::toSecondHeight(double now) {
  second_ = true;
  bad_hits_ = 0;
  stage_ = Stage::to_second;
  say("lowering the tool for hits at a second height", 0.83);
  Axes3 here{};
  double to_go = 0.0;
  readPosition(*state_, here, to_go);
  const Axes3 station = stationPosition();
  Axes3 beside = here;
  for (std::size_t axis = 0; axis < 2; ++axis) beside[axis] = station[axis];
  Axes3 down = beside;
  down[2] = station[2] - lowered();
  move(now, here, {{beside, parameters_.jog_feed}, {down, parameters_.approach_feed}});
}

/// The first height's hits stand for themselves.
void HammerSequence::withoutSecond(double now, const std::string& why) {
  no_second_ = why;
  second_hits_.clear();
  calibration_.reset();
  say("no second height: " + why, 0.95);
  evaluate();
  retract(now);
}

void HammerSequence::badHit(double now, const std::string& why, bool bad_data) {
  if (++bad_hits_ > parameters_.max_bad_hits) {
    if (second_) return withoutSecond(now, std::to_string(bad_hits_) + " useless hits, the last: " + why);
    return abort(now, bad_data ? FrfCode::bad_data : FrfCode::no_hit,
                 std::to_string(bad_hits_) + " useless hits, the last: " + why);
  }
  say("hit thrown away: " + why, hitProgress());
  wait_ = Wait::rest;
  rest_until_ = now + parameters_.rest_time;
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
