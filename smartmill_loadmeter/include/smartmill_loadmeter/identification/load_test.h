#pragma once

#include <optional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/calibration/load_meter.h"
#include "smartmill_loadmeter/identification/temperature_watch.h"
#include "smartmill_loadmeter/motor/force_record.h"
#include "smartmill_loadmeter/motor/motor_chain.h"

namespace smartmill::loadmeter {

/// Steady state of one test.
struct LoadTest {
  CuttingCondition condition;
  double speed = 0.0;      ///< [rad/s] mean
  double speed_std = 0.0;  ///< [rad/s] of the mean
  MeanVoltage voltage;
  std::vector<double> voltages;  ///< [V] steady readings
  std::vector<double> times;     ///< [s] of `voltages`, since the first
  int readings = 0;
  double stamp = 0.0;              ///< [s] of its last reading
  double duration = 0.0;           ///< [s] steady
  TemperatureReading temperature;  ///< [K] of the spindle motor, mean
  std::optional<MotorMeasurement> motor;
  std::optional<MotorForce> force;         ///< of a cut, with calibrated motors
  std::optional<ForceMeasurement> sensor;  ///< by a force sensor, if used

  bool isCut() const { return condition.kind == CuttingCondition::Kind::cut; }
  /// Computes `voltage` from the readings. @param step [V] resolution of the load meter.
  void computeMean(const Spindle& spindle, double step);
  double variance() const;  ///< [V2] of the readings; 0 without any
  /// Standard deviation [V] of the mean voltage that corresponds to that of the torque at the motor, by load
  /// meter and speed.
  double torqueStdAsVoltage() const;
};

/// Resolution of readings [V]: the model's, or a coarser one that they show (a controller may round again).
double resolutionOf(const std::vector<double>& readings, double resolution);

}  // namespace smartmill::loadmeter
