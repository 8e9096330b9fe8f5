#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter/identification/curve_finder.h"
#include "smartmill_loadmeter/identification/identification.h"

namespace smartmill::loadmeter {

/// Parameters of loadmeter_node and of `coefficients` on a bag.
struct NodeParameters {
  std::string model;
  std::string database, machine;
  bool keep_cuts = true;
  std::string fleet;
  double fleet_period = 60.0;
  IdentificationParameters identification;
  std::string motor_calibration;
  bool motor_learn = false, motor_servo = false;

  bool readsMotors() const { return motor_learn || !motor_calibration.empty(); }
  bool force_sensor = false;
  bool force_curve = true;
  CurveParameters curve;
  double hold_back = 0.05;
  double input_timeout = 3.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of loadmeter_node (package smartmill_loadmeter): cutting coefficients from the spindle's "
        "load "
        "meter.");
    table.atLaunch("model", model,
                   "path of a smartmill-model/1 file; its spindle section tells what the load meter shows");
    table.section();
    table.text("database", database,
               "path of the SQLite file that keeps what this machine identifies; empty: this run only");
    table.text("machine", machine, "name of this machine, in every record of its database");
    table.flag("keep_cuts", keep_cuts,
               "true: every cut enters the database, with its condition and what it says");
    table.text("fleet", fleet,
               "address of the fleet's server, postgresql://USER@HOST/DATABASE, to which the file is pushed; "
               "empty: none");
    table.number("fleet_period", fleet_period, "s", Range::openLow(0.0, 86400.0),
                 "between pushes; a server that is away is asked again after it");
    identification.declare(table);
    table.section("Motor currents.");
    table.text("motor_calibration", motor_calibration,
               "path of what `calibrate --standard-cuts` wrote; empty: daq/motor_current is not used");
    table.flag("motor_learn", motor_learn,
               "true: daq/motor_current is used and calibrated by the session's own air moves and cuts");
    table.flag(
        "motor_servo", motor_servo,
        "true: the record of Servo Guide, daq/servo, takes the place of daq/motor_current, from its trigger "
        "on; calibrated or learnt alike");
    table.part("motor_", identification.motor);
    table.section("Force of each cut by all that is measured of it (force/estimate).");
    table.flag("force_sensor", force_sensor,
               "whether force/compensated takes part, beside load meter and motors");
    table.part("force_", identification.force);
    table.section("Force over chip thickness (material/force_curve).");
    table.flag(
        "force_curve", force_curve,
        "whether force/compensated over spindle/angle of each cut is made one; without either none comes");
    table.part("curve_", curve);
    table.section("Streams.");
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "an event may arrive after its stamp and still be in order");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "without any input: data has ended, or its source is stale");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    identification.validate();
    checkBounds(curve);
    if (isFleet(database))
      throw Error("database: a file is due, a machine does not wait for a server (fleet)");
    if (!fleet.empty() && !isFleet(fleet))
      throw Error("fleet: '" + fleet + "': postgresql://USER@HOST/DATABASE is due");
    if (!fleet.empty() && database.empty()) throw Error("fleet: without a database there is nothing to push");
    if (motor_learn && !motor_calibration.empty())
      throw Error("motor_learn: with a motor_calibration there is nothing to learn");
    if (motor_servo && !readsMotors()) throw Error("motor_servo: without motor_learn or motor_calibration");
    if (readsMotors() && !motor_servo && !identification.motor.any())
      throw Error("motor_phase_per_metre: all 0, and motor_phase_per_revolution too: no current can be read");
  }
};

}  // namespace smartmill::loadmeter
