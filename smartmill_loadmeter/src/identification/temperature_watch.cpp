#include "smartmill_loadmeter/identification/temperature_watch.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"

namespace smartmill::loadmeter {

namespace {

constexpr double KEPT = 14400.0;          // [s] history: longer than a cut
constexpr double ROTATING = 1.0;          // [rad/s] spindle speed above which it heats its motor
constexpr double LONGEST_INTERVAL = 1.0;  // [s] between two loads that belong together

}  // namespace

void TemperatureWatch::handle(const MachineTemperature& temperature) {
  Reading reading{temperature.stamp, temperature.spindle_motor, {}, false};
  reading.axes.fill(std::numeric_limits<double>::quiet_NaN());
  for (std::size_t a = 0; a < 3; ++a) {
    const std::optional<std::size_t> at = controllerAxis(temperature.axes, a);
    if (at && *at < temperature.axis_motor.size()) reading.axes[a] = temperature.axis_motor[*at];
  }
  if (!readings_.empty() && reading.spindle != readings_.back().spindle) unchanged_ = 0.0;
  reading.stuck = parameters_.stuck_time > 0.0 && unchanged_ > parameters_.stuck_time;
  readings_.push_back(reading);
  while (readings_.front().stamp < reading.stamp - KEPT) readings_.pop_front();
}

void TemperatureWatch::handle(const LoadSample& sample) {
  const double interval = sample.stamp - last_load_;
  last_load_ = sample.stamp;
  if (interval > 0.0 && interval < LONGEST_INTERVAL && std::abs(sample.spindle_speed) > ROTATING)
    unchanged_ += interval;
}

void TemperatureWatch::clear() {
  readings_.clear();
  unchanged_ = 0.0;
  last_load_ = std::numeric_limits<double>::quiet_NaN();
}

template <class Value>
TemperatureReading TemperatureWatch::mean(double from, double to, const std::string& what,
                                          Value value) const {
  TemperatureReading result;
  double sum = 0.0, count = 0.0, before = 0.0, last = from - parameters_.max_age;
  bool any_before = false;
  for (const Reading& reading : readings_) {
    if (reading.stamp < from - parameters_.max_age || reading.stamp > to) continue;
    const double kelvin = value(reading);
    if (std::isnan(kelvin)) continue;  // not reported
    if (!(kelvin >= parameters_.lowest && kelvin <= parameters_.highest)) {
      result.fault = formatted("%s implausible: %.1f K, expected %.0f to %.0f K", what.c_str(), kelvin,
                               parameters_.lowest, parameters_.highest);
      return result;
    }
    if (any_before && reading.stamp - last > parameters_.max_age) {
      result.fault = formatted("%s late: no reading for %.0f s, expected one every %.0f s", what.c_str(),
                               reading.stamp - last, parameters_.max_age);
      return result;
    }
    if (reading.stamp >= from) {
      sum += kelvin;
      count += 1.0;
    } else {
      before = kelvin;
    }
    any_before = true;
    last = reading.stamp;
  }
  const bool reported = std::any_of(readings_.begin(), readings_.end(),
                                    [&](const Reading& r) { return !std::isnan(value(r)); });
  if (!reported) return result;
  if (!any_before || to - last > parameters_.max_age) {
    result.fault = formatted("%s late: no reading in the last %.0f s", what.c_str(), parameters_.max_age);
    return result;
  }
  result.value = count > 0.0 ? sum / count : before;
  return result;
}

TemperatureReading TemperatureWatch::spindle(double from, double to) const {
  TemperatureReading result =
      mean(from, to, "spindle motor temperature", [](const Reading& r) { return r.spindle; });
  const bool stuck = std::any_of(readings_.begin(), readings_.end(), [&](const Reading& r) {
    return r.stuck && r.stamp >= from - parameters_.max_age && r.stamp <= to;
  });
  if (!result.known() || !stuck) return result;
  result.fault = formatted("spindle motor temperature stuck: %.1f K for more than %.0f s of rotation",
                           result.value, parameters_.stuck_time);
  result.value = std::numeric_limits<double>::quiet_NaN();
  return result;
}

TemperatureReading TemperatureWatch::axis(std::size_t axis, double from, double to) const {
  return mean(from, to, std::string("motor temperature of ") + "XYZ"[axis],
              [axis](const Reading& r) { return r.axes[axis]; });
}

std::string TemperatureWatch::fault(double now) const {
  return spindle(now, now).fault;
}

}  // namespace smartmill::loadmeter
