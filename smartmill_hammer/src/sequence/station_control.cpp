#include "station_control.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/same_time.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/solenoid_crosstalk.h"
#include "station_paths.h"

namespace smartmill::hammer {
namespace {

/// Angles of M119: 0..4095 (thesis eq. 6.1).
constexpr double COUNTS = 4096.0;

Command commandOf(Command::Kind kind, double now) {
  Command command;
  command.kind = kind;
  command.stamp = now;
  return command;
}

}  // namespace

StationControl::StationControl(const HammerParameters& parameters, const StationAxes& axes, double range_volt)
    : parameters_(parameters),
      axes_(axes),
      range_volt_(range_volt),
      motion_(parameters),
      average_(parameters),
      collector_({parameters.trigger_force, parameters.pre_trigger, parameters.record_length}),
      cross_collector_({parameters.trigger_force, parameters.pre_trigger, parameters.record_length}) {
}

void StationControl::start(double stamp, const std::string& direction) {
  direction_ = direction;
  commanded_ = has_cross_ = cross_selected_ = range_watched_ = false;
  spindle_moves_ = near_samples_ = 0;
  average_.reset();
  collector_.reset();
  cross_collector_.reset();
  wait_ = Wait::readiness;
  sent_ = stamp;
  deadline_ = stamp + parameters_.motion_timeout;
}

// ------------------------------------------------------------------------------------------ commands

void StationControl::send(Command command, Wait wait, double timeout) {
  sent_ = command.stamp;
  deadline_ = command.stamp + timeout;
  wait_ = wait;
  commanded_ = true;
  commands_.push_back(std::move(command));
}

void StationControl::orient(double now, double angle) {
  Command c = commandOf(Command::Kind::orient, now);
  const double counts = std::round(angle / units::TWO_PI * COUNTS);
  c.angle = (counts - COUNTS * std::floor(counts / COUNTS)) * units::TWO_PI / COUNTS;
  motion_.expectAngle(c.angle);
  ++spindle_moves_;
  send(std::move(c), Wait::angle, parameters_.orient_timeout);
}

void StationControl::jog(double now, std::size_t axis, double distance, double feed) {
  if (axes_.isTurned()) {
    Axes3 target = motion_.position();
    target[axis] += distance;
    return move(now, motion_.position(), {{target, feed}}, jogTolerance(distance));
  }
  Command c = commandOf(Command::Kind::jog, now);
  c.axis = AXIS_NAMES[axis];
  c.distance = distance;
  c.feed = feed;
  // From the commanded position, not the displayed one, so that the display's rounding does not accumulate.
  Axes3 target = motion_.position();
  target[axis] += distance;
  motion_.expectPosition(target, jogTolerance(distance));
  send(std::move(c), Wait::position, parameters_.motion_timeout);
}

double StationControl::jogTolerance(double distance) const {
  return std::min(parameters_.position_tolerance, 0.25 * std::abs(distance));
}

void StationControl::move(double now, const Axes3& from, std::vector<Waypoint> path) {
  move(now, from, std::move(path), parameters_.position_tolerance);
}

void StationControl::move(double now, const Axes3& from, std::vector<Waypoint> path, double tolerance) {
  Command c = commandOf(Command::Kind::move, now);
  c.from = axes_.toMachine(from);
  // In increments that the controller can command.
  Axes3 position = c.from;
  for (Waypoint& w : path) {
    const Axes3 end = axes_.toMachine(w.position);
    for (std::size_t i = 0; i < 3; ++i) position[i] += roundTo(end[i] - position[i], parameters_.resolution);
    w.position = position;
  }
  motion_.expectPosition(axes_.toStation(position), tolerance);
  c.path = std::move(path);
  send(std::move(c), Wait::position, parameters_.motion_timeout);
}

void StationControl::strike(double now) {
  Command c = commandOf(Command::Kind::strike, now);
  c.direction = direction_;
  collector_.arm();
  cross_collector_.arm();
  send(std::move(c), Wait::hit, parameters_.strike_timeout);
}

void StationControl::strikeAfterRest(double now) {
  wait_ = Wait::rest;
  rest_until_ = now + parameters_.rest_time;
}

void StationControl::measureVoltage(double from) {
  average_.start(from);
  wait_ = Wait::voltage;
  deadline_ = from + parameters_.average_timeout;
}

void StationControl::stop(double now) {
  motion_.expectStandstill();
  send(commandOf(Command::Kind::stop, now), Wait::standstill, parameters_.stop_timeout);
}

void StationControl::release() {
  wait_ = Wait::nothing;
  collector_.disarm();
  cross_collector_.disarm();
}

std::vector<Command> StationControl::takeCommands() {
  return std::exchange(commands_, {});
}

// -------------------------------------------------------------------------------------------- inputs

ControlEvent StationControl::complete() {
  wait_ = Wait::nothing;
  return MotionDone{};
}

ControlEvent StationControl::handle(const CncState& state) {
  state_ = state;
  if (const std::string fault = motionFault(state); !fault.empty())
    return ControlFault{FrfCode::motion_failed, fault};
  if (wait_ == Wait::readiness) {
    if (state.stamp >= sent_ && !state.motion) return complete();
    return {};
  }
  const std::optional<AxesPosition> axes = position();
  if (!axes)
    return ControlFault{FrfCode::motion_failed, "cnc/state: expected the axes x, y and z, one is missing"};
  const bool waits = wait_ == Wait::position || wait_ == Wait::standstill;
  return waits && canComplete(state.stamp) && motion_.isComplete(state, *axes) ? complete() : ControlEvent();
}

std::optional<AxesPosition> StationControl::position() const {
  std::optional<AxesPosition> axes = state_ ? axesPosition(*state_) : std::nullopt;
  if (axes) axes->position = axes_.toStation(axes->position);
  return axes;
}

ControlEvent StationControl::handle(const SpindleAngle& angle) {
  return wait_ == Wait::angle && canComplete(angle.stamp) && motion_.isComplete(angle) ? complete()
                                                                                       : ControlEvent();
}

/// The controller starts with a delay: an earlier input may still be from before the motion.
bool StationControl::canComplete(double stamp) const {
  return stamp > sent_ + parameters_.command_delay + SAME_TIME;
}

bool StationControl::isTooNear(double volt) {
  near_samples_ = range_watched_ && volt >= parameters_.range_share * range_volt_ ? near_samples_ + 1 : 0;
  return near_samples_ >= parameters_.near_samples;
}

ControlEvent StationControl::handle(const StationSample& s) {
  has_cross_ = s.cross_volt.has_value();
  const double volt = cross_selected_ ? s.cross_volt.value_or(NOT_A_NUMBER) : s.volt;
  auto record = collector_.add(s.time, s.index, s.rate, s.force, volt);
  std::optional<HitCollector::Record> cross;
  if (s.cross_volt) cross = cross_collector_.add(s.time, s.index, s.rate, s.force, *s.cross_volt);
  if (isTooNear(volt))
    return ControlFault{
        FrfCode::no_flute,
        formatted("the tool is too near to the sensor: %.2f V is the end of its range", volt)};
  if (record && wait_ == Wait::hit) return hitOf(std::move(*record), std::move(cross));
  if (wait_ == Wait::rest && s.time >= rest_until_ - SAME_TIME) {
    strike(s.time);
  } else if (wait_ == Wait::voltage) {
    const auto mean = average_.add(s.time, s.index, s.rate, volt);
    if (!average_.fault().empty()) return ControlFault{FrfCode::bad_data, average_.fault()};
    if (!mean) return {};
    wait_ = Wait::nothing;
    return *mean;
  }
  return {};
}

ControlEvent StationControl::hitOf(HitCollector::Record record, std::optional<HitCollector::Record> cross) {
  removeSolenoidCrosstalk(record.hit, parameters_.coil_share);
  RecordedHit result{std::move(record.hit), std::nullopt, {record.fault, true}};
  if (cross) {
    removeSolenoidCrosstalk(cross->hit, parameters_.coil_share);
    if (result.fault.text.empty()) result.fault.text = cross->fault;
    result.cross = std::move(cross->hit);
  }
  return result;
}

ControlEvent StationControl::checkDeadline(double now) {
  if (now <= deadline_) return {};
  const double waited = now - sent_;
  switch (wait_) {
    case Wait::readiness:
      return ControlFault{FrfCode::motion_failed, state_ ? "the axes are moving" : "no message on cnc/state"};
    case Wait::angle:
      return ControlFault{FrfCode::motion_failed,
                          formatted("the spindle did not reach %.2f deg within %.1f s",
                                    units::degFromRad(motion_.angle()), waited)};
    case Wait::position:
      return ControlFault{FrfCode::motion_failed,
                          formatted("the axes did not reach their target within %.1f s", waited)};
    case Wait::standstill:
      return ControlFault{FrfCode::motion_failed, "the axes did not come to rest after the stop"};
    case Wait::voltage:
      return ControlFault{FrfCode::bad_data, "no valid voltage of the displacement sensor"};
    case Wait::hit:
      if (collector_.recording()) return {};
      collector_.disarm();
      cross_collector_.disarm();
      return RecordedHit{
          {},
          std::nullopt,
          {formatted("no hit within %.1f s of the command", parameters_.strike_timeout), false}};
    default:
      return {};
  }
}

}  // namespace smartmill::hammer
