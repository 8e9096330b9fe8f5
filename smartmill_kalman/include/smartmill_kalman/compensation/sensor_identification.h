#pragma once

#include <functional>
#include <string>

#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_kalman/compensation/compensation_outputs.h"
#include "smartmill_kalman/compensation/sensor_forces.h"
#include "smartmill_kalman/sensor/plate_calibrator.h"
#include "smartmill_kalman/sensor/sensor_measurement.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibrator.h"
#include "smartmill_kalman/tuning/tuning_records.h"

namespace smartmill::kalman {

/// Identifies the force sensor on request: taps (SensorMeasurement) and steps of a calibration
/// (SpindleSensorCalibrator, PlateCalibrator). The identified sensor replaces the one in use. The step FIT
/// also tunes the filters' process noise from the cuts so far (tuneMemory). Inputs in stamp order.
class SensorIdentification {
 public:
  /// @param filter its bandwidth is that of a transfer matrix @param forces with the sensor in use @param
  /// sorter of the inputs
  SensorIdentification(const TapParameters& taps, const HarmonicFilterParameters& filter,
                       SensorForces& forces, const StreamSorter& sorter, const CompensationOutputs& outputs);

  /// Calibration of the spindle sensor in use: the base of the next. @param length [m] of tool and holder
  void use(const SpindleSensorCalibration& calibration, double length);
  /// Matrix of a plate, in use from now on, up to a bandwidth [Hz]. @throws Error.
  void use(const TransferMatrix& matrix, double bandwidth);
  /// State of the sensor in use without a calibration of its own.
  void startUncalibrated();
  const SensorCalibrationState& calibration() const { return calibration_; }
  /// Block of the force sensor, all channels. @throws Error when a channel is missing.
  void handleChannels(const SampleBlock& block);
  /// Forces of the same block, fx, fy, fz.
  void handleForces(const SampleBlock& forces);
  void handleHammer(const SampleBlock& block);
  void handle(const SpindleAngle& angle) { tuning_.handle(angle); }
  void handle(const CuttingCondition& condition) { tuning_.handle(condition); }
  /// @param begin called with whether no other measurement runs; returns whether to start; may be empty
  void start(const MeasureFrfGoal& goal, const std::function<bool(bool)>& begin);
  void start(const CalibrationGoal& goal, const std::function<bool(bool)>& begin);
  void cancelCalibration();
  void event(const std::function<void(SensorMeasurement&)>& action);
  void publishResults();
  void reset();

  bool isMeasuring() const { return measurement_.active(); }
  const SpindleSensorCalibrator& calibrator() const { return calibrator_; }
  const PlateCalibrator& plate() const { return plate_; }

 private:
  void publishCalibration();
  void apply(CalibrationResult result);
  void setCalibration(const CalibrationResult& result);
  void install(const TransferMatrix& matrix, double bandwidth);
  void tune(CalibrationResult& result);

  TapParameters taps_;
  HarmonicFilterParameters filter_;
  SensorForces& forces_;
  const StreamSorter& sorter_;
  const CompensationOutputs& outputs_;
  SensorMeasurement measurement_;
  SpindleSensorCalibrator calibrator_;
  PlateCalibrator plate_;
  TuningRecords tuning_;
  SensorCalibrationState calibration_;
  bool calibrated_here_ = false;  // by goals: ends with a restart of the recording
};

}  // namespace smartmill::kalman
