#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_loadmeter/database/database_location.h"
#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter/identification/force_curve_identification.h"
#include "smartmill_loadmeter/identification/identification.h"

namespace smartmill::loadmeter {

/// Parameters of loadmeter_node and of `coefficients` on a bag.
struct NodeParameters {
  std::string model;
  std::string database = DATABASE_AUTO, machine;
  bool keep_cuts = true;
  std::string fleet;
  double fleet_period = 60.0;
  IdentificationParameters identification;
  std::string motor_calibration;
  bool motor_learn = false, motor_servo = false;

  bool usesMotors() const { return motor_learn || !motor_calibration.empty(); }
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
    table.atLaunch("model", model, "path of a smartmill-model/1 file with a spindle section");
    table.section();
    table.text(
        "database", database,
        "path of the SQLite file for this machine's records; auto: NAME.sqlite in $STATE_DIRECTORY, "
        "$XDG_DATA_HOME/smartmill or ~/.local/share/smartmill, where NAME is that of the machine or of "
        "its model file; none or empty: records of this run only");
    table.text("machine", machine, "name of this machine in its records; empty: unnamed");
    table.flag("keep_cuts", keep_cuts,
               "true: every cut is stored with its condition and the running estimate");
    table.text("fleet", fleet,
               "address of the fleet's server, postgresql://USER@HOST/DATABASE, to which the file is pushed; "
               "empty: none");
    table.number("fleet_period", fleet_period, "s", Range::openLow(0.0, 86400.0),
                 "between pushes, also after a failed one");
    identification.declare(table);
    table.section("Temperature of the motors (machine/temperature).");
    table.part("temperature_", identification.temperature);
    table.section("Measured dimensions of parts (inspection/feature).");
    table.part("inspection_", identification.inspection);
    table.section("Motor currents.");
    table.text(
        "motor_calibration", motor_calibration,
        "path of a motor calibration (`calibrate --standard-cuts`); empty: daq/motor_current is not used");
    table.flag("motor_learn", motor_learn,
               "true: daq/motor_current is used, calibrated by the session's own air moves and cuts");
    table.flag("motor_servo", motor_servo,
               "true: the record of Servo Guide, daq/servo, from its trigger on, is used instead of "
               "daq/motor_current");
    table.part("motor_", identification.motor);
    table.section("Force of each cut from all its measurements (force/estimate).");
    table.flag("force_sensor", force_sensor,
               "true: force/compensated is used in addition to load meter and motors");
    table.part("force_", identification.force);
    table.section("Force over chip thickness (material/force_curve).");
    table.flag("force_curve", force_curve,
               "true: a force curve is identified from force/compensated and spindle/angle of the cuts");
    table.part("curve_", curve);
    table.section("Streams.");
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "longest delay of an event between its stamp and its arrival");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without input after which the data have ended or their source is stale");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    identification.validate();
    checkBounds(curve);
    if (isServerUrl(database))
      throw Error(
          "database: expected a file, because a machine does not wait for a server (parameter fleet)");
    if (!fleet.empty() && !isServerUrl(fleet))
      throw Error("fleet: '" + fleet + "': expected postgresql://USER@HOST/DATABASE");
    if (!fleet.empty() && isWithoutFile(database)) throw Error("fleet: requires a database to push");
    if (motor_learn && !motor_calibration.empty()) throw Error("motor_learn: excludes motor_calibration");
    if (motor_servo && !usesMotors()) throw Error("motor_servo: requires motor_learn or motor_calibration");
    if (usesMotors() && !motor_servo && !identification.motor.any())
      throw Error("motor_phase_per_metre: expected a value > 0 in it or in motor_phase_per_revolution");
  }
};

}  // namespace smartmill::loadmeter
