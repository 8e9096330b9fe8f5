#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/model/force_sensor_kind.h"
#include "smartmill_core/names.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"

namespace smartmill::kalman {

/// Parameters of kalman_node and of `compensate` on a bag.
struct NodeParameters {
  std::string model;  ///< may be empty in tools with an option --model
  std::string sensor = "table";
  std::string force_input = names::DYNAMOMETER;
  std::string sensor_matrix, spindle_sensor, plate_taps, memory_over_speed;
  double spindle_sensor_length = 0.139;
  CompensationParameters compensation;
  AutoSetting harmonic_weights;
  double hold_back = 0.05;
  double wrench_rate = 100.0;
  double drift_limit = 0.0;
  double model_max_age = 0.0;
  double input_timeout = 1.0;
  bool command_machine = true;
  TapParameters taps;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of kalman_node (package smartmill_kalman): force at the tool from a force sensor.");
    table.atLaunch("model", model,
                   "path of a smartmill-model/1 file; its force_sensor section gives the sensor's modes");
    table.section();
    table.choice(
        "sensor", sensor, forceSensorWords(),
        "table: dynamometer; spindle: six sensors in the spindle on daq/spindle_force, taps are on the "
        "tool; plate: 3 or 6 channels on force_input; spindle and plate publish no force until they "
        "are calibrated (action kalman/calibrate, spindle_sensor, plate_taps)");
    table.text("force_input", force_input, "topic of the force sensor; daq/spindle_force: as sensor spindle");
    table.text("sensor_matrix", sensor_matrix,
               "smartmill-sensor-matrix/1 file (compensate --coupled --matrix-out): corrects cross-talk");
    table.text("spindle_sensor", spindle_sensor,
               "smartmill-spindle-sensor/1 file: calibration of six sensors x1 x2 y1 y2 z1 z2; empty: "
               "calibrate them "
               "first (action kalman/calibrate)");
    table.number("spindle_sensor_length", spindle_sensor_length, "m", Range::positive(),
                 "length of tool and holder, for spindle_sensor");
    table.text("plate_taps", plate_taps,
               "smartmill-taps/1 file: the sensor's 3x3 or 6x6 matrix is inverted up to bandwidth instead of "
               "filtering; 10 ms latency");
    table.text(
        "memory_over_speed", memory_over_speed,
        "smartmill-memory/1 file (kalman/calibrate, step FIT after cuts): process noise of the filters "
        "over the spindle speed; a spindle_sensor file has its own");
    compensation.declare(table);
    table.choice(
        "harmonic_weights", harmonic_weights.word, {"auto", "always", "never"},
        "each harmonic enters the force of a steady cut by its signal-to-noise ratio (Wiener); auto: with "
        "the sensor in the spindle, whose noise is not small compared with the force");
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "time after its stamp that an event may arrive and still be in order");
    table.number("wrench_rate", wrench_rate, "Hz", Range::positive(), "rate of force/wrench");
    table.number("drift_limit", drift_limit, "N", Range::notNegative(),
                 "zero of the sensor without cutting above which diagnostics warn; 0: not checked");
    table.number("model_max_age", model_max_age, "s", Range::notNegative(),
                 "age of the measured modes above which diagnostics warn; 0: not checked");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without samples after which diagnostics report a dead input");
    table.section("Taps on the workpiece (kalman/measure_frf): measured modes replace those in use.");
    table.flag("command_machine", command_machine,
               "false: replay; daq/strike is not called, the recorded hits are used");
    taps.declare(table);
  }
  ForceSensorKind kind() const {
    if (force_input == names::SPINDLE_FORCE) return ForceSensorKind::spindle;
    return plate_taps.empty() ? forceSensorKind(sensor) : ForceSensorKind::plate;
  }
  /// Those of the sensor in use.
  CompensationParameters compensationOfSensor() const {
    CompensationParameters own = compensation;
    own.filter.weighted =
        harmonic_weights.isAlways() || (harmonic_weights.isAuto() && kind() == ForceSensorKind::spindle);
    return own;
  }
  /// Topic of the force sensor.
  std::string input() const {
    return kind() == ForceSensorKind::spindle ? names::SPINDLE_FORCE : force_input;
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    if (force_input.empty()) throw Error("force_input: empty, expected a topic");
    if (!plate_taps.empty() && !(spindle_sensor.empty() && sensor_matrix.empty()))
      throw Error("plate_taps: set together with sensor_matrix or spindle_sensor, expected only one of them");
    if (sensor == "spindle" && !plate_taps.empty())
      throw Error("plate_taps: set together with sensor spindle, expected sensor plate");
    if (sensor == "plate" && force_input == names::SPINDLE_FORCE)
      throw Error("force_input: daq/spindle_force, expected the topic of the plate with sensor plate");
    compensation.validate();
    taps.validate();
  }
};

}  // namespace smartmill::kalman
