#pragma once

#include <array>
#include <deque>
#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/machine_temperature.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::loadmeter {

/// When a reported temperature is usable.
struct TemperatureParameters {
  double max_age = 30.0;
  double lowest = 274.0;
  double highest = 453.0;
  double stuck_time = 14400.0;

  void declare(ParameterTable& table) {
    table.number("max_age", max_age, "s", Range::openLow(0.0, 3600.0),
                 "longest time between readings during a test; six periods of the bridge");
    table.number("lowest", lowest, "K", Range::closed(200.0, 300.0),
                 "lowest plausible temperature; a missing sensor often reads 0 deg C");
    table.number("highest", highest, "K", Range::closed(310.0, 1000.0),
                 "highest plausible temperature; insulation of class H permits 180 deg C");
    table.number("stuck_time", stuck_time, "s", Range::notNegative(),
                 "time with rotating spindle without any change of its motor's temperature after which its "
                 "sensor counts as stuck; 0: not checked");
  }
};

/// A temperature, or why there is none.
struct TemperatureReading {
  double value = std::numeric_limits<double>::quiet_NaN();  ///< [K]
  std::string fault;  ///< one line; empty with a value, or when the controller reports none

  bool known() const { return value == value; }
};

/// Temperatures of the motors during tests (topic machine/temperature): mean over a time, if the readings are
/// complete and plausible. Broms: friction decreases by 0.8 %/K, the torque per ampere by 0.11 %/K.
class TemperatureWatch {
 public:
  explicit TemperatureWatch(const TemperatureParameters& parameters) : parameters_(parameters) {}

  void handle(const MachineTemperature& temperature);
  /// Speed of the spindle, which heats its motor.
  void handle(const LoadSample& sample);
  void clear();

  /// Spindle motor from one time to another [s].
  TemperatureReading spindle(double from, double to) const;
  /// Servo motor of machine axis X, Y, Z (0..2); encoder temperature is not used.
  TemperatureReading axis(std::size_t axis, double from, double to) const;
  /// Why the present temperature of the spindle motor is not usable; empty: it is, or none was ever reported.
  std::string fault(double now) const;
  bool ever() const { return !readings_.empty(); }
  double newest() const { return readings_.back().spindle; }  ///< [K] precondition: ever()

 private:
  struct Reading {
    double stamp;                // [s]
    double spindle;              // [K]
    std::array<double, 3> axes;  // [K]
    bool stuck;                  // of the spindle
  };
  template <class Value>
  TemperatureReading mean(double from, double to, const std::string& what, Value value) const;

  TemperatureParameters parameters_;
  std::deque<Reading> readings_;
  double unchanged_ = 0.0;  // [s] with rotating spindle since the last change
  double last_load_ = std::numeric_limits<double>::quiet_NaN();  // [s]
};

}  // namespace smartmill::loadmeter
