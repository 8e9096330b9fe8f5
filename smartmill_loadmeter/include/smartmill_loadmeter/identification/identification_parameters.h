#pragma once

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_loadmeter/identification/temperature_watch.h"
#include "smartmill_loadmeter/inspection/inspection_parameters.h"
#include "smartmill_loadmeter/motor/force_estimate.h"
#include "smartmill_loadmeter/motor/motor_chain.h"

namespace smartmill::loadmeter {

struct IdentificationParameters {
  double speed_tolerance = 0.02;
  double settle_time_constants = 8.0;
  double guard_time = 0.05;
  double path_tolerance = 1.0e-3;
  int minimum_readings = 10;
  double maximum_gap = 0.5;
  double production_memory = 1800.0;
  double largest_runout = 3.0e-5;
  MotorParameters motor;          ///< for daq/motor_current
  ForceEstimateParameters force;  ///< for the force of each cut
  TemperatureParameters temperature;
  InspectionParameters inspection;  ///< for measured dimensions of parts

  /// Without those of `motor`, `force`, `temperature` and `inspection`, whose keys have a prefix.
  void declare(ParameterTable& table) {
    table.number("speed_tolerance", speed_tolerance, "1", Range::open(0.0, 0.5),
                 "share of the commanded spindle speed within which the speed is reached");
    table.number(
        "settle_time_constants", settle_time_constants, "1", Range::closed(5.0, 1000.0),
        "waiting time after a change in time constants of the load meter; after 8, 0.03 % of a step remains");
    table.number("guard_time", guard_time, "s", Range::closed(0.0, 10.0),
                 "readings dropped before the end of a steady state, because stamps are times of replies");
    table.number("path_tolerance", path_tolerance, "m", Range::openLow(0.0, 1.0),
                 "largest distance from the line between steady_from and steady_to");
    table.number("minimum_readings", minimum_readings, "1", Range::atLeast(2),
                 "steady readings that a test must have");
    table.number("maximum_gap", maximum_gap, "s", Range::openLow(0.0, 60.0),
                 "longest time without controller state or load in a steady state");
    table.number("production_memory", production_memory, "s", Range::openLow(0.0, 1e7),
                 "cutting time after which the weight of a cut in the running estimate is 1/e");
    table.number("largest_runout", largest_runout, "m", Range::closed(0.0, 1e-3),
                 "largest possible offset of the cutter axis; 0.0: runout is not estimated");
  }
  /// @throws Error with key and value.
  void validate() const;

  /// Time [s] of a steady part without readings: settling of the load meter and guard time at the end.
  double timeWithoutReadings(const Spindle& spindle) const;
};

}  // namespace smartmill::loadmeter
