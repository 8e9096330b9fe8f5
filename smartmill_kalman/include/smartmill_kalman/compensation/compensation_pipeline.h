#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "smartmill_core/model/force_sensor_kind.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_kalman/compensation/force_compensation.h"
#include "smartmill_kalman/compensation/invalid_samples.h"
#include "smartmill_kalman/compensation/matrix_compensation.h"
#include "smartmill_kalman/sensor/plate_calibrator.h"
#include "smartmill_kalman/sensor/sensor_measurement.h"
#include "smartmill_kalman/sensor/spindle_force_sensor.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibrator.h"
#include "smartmill_kalman/sensor/stuck_channel.h"

namespace smartmill::kalman {

/// The kalman node without ROS: puts its inputs into stamp order, compensates the force, and measures or
/// calibrates the sensor on request; a measured sensor replaces the one in use. The node and the offline
/// tool feed this class, so that both give the same numbers.
class CompensationPipeline {
 public:
  /// Receivers of the results; empty ones are not called.
  struct Outputs {
    ForceOutputs force;
    std::function<void(const StrikeCommand&)> strike = {};
    std::function<void(const TapFeedback&)> feedback = {};
    std::function<void(const SensorResult&)> result = {};
    std::function<void(const CalibrationResult&)> calibration = {};
    /// A block of the force sensor could not be compensated. Empty: the push() that released it throws.
    std::function<void(const std::string& reason)> block_error = {};
  };

  /// @param sensor of the machine model, for axes that are not measured @param hold_back [s], see
  /// StreamSorter. @throws Error.
  CompensationPipeline(const CompensationParameters& parameters, const TapParameters& taps,
                       const ForceSensor& sensor, double hold_back, Outputs outputs);
  CompensationPipeline(const CompensationPipeline&) = delete;
  CompensationPipeline& operator=(const CompensationPipeline&) = delete;

  /// Accepts blocks of six sensors in the spindle (channels x1 .. z2); invalid samples give NaN.
  /// @param length [m] of tool and holder. @throws Error.
  void useSpindleSensor(const SpindleSensorCalibration& calibration, double length);
  /// Length [m] of tool and holder for a calibration on the machine.
  void setSpindleSensorLength(double length) { spindle_length_ = length; }
  /// Kind of the sensor. Six sensors in the spindle and a plate give no force until they are calibrated.
  void useKind(ForceSensorKind kind);
  bool isUncalibrated() const;
  bool invertsMatrix() const { return inverse_.has_value(); }
  const SensorCalibrationState& calibration() const { return calibration_; }
  /// Inverts the transfer matrix of a sensor of 3 or 6 channels instead of filtering. @throws Error.
  void useTransferMatrix(const TransferMatrix& matrix, double bandwidth);
  /// Sensor with cross-talk; its diagonal replaces the machine model's sensor.
  void useMatrix(const SensorMatrix& matrix) {
    matrix_ = matrix;
    useModelSensors();
  }
  /// @return null without a sensor in the spindle.
  const SpindleSensorHealth* spindleHealth() const { return spindle_ ? &spindle_->health() : nullptr; }

  /// Block of the force sensor. @throws Error when it does not suit the sensor.
  void push(SampleBlock block);
  /// Block of the hammer, on machines that have one. @throws Error when the channel is missing or not in N.
  void pushHammer(SampleBlock block);
  void push(const SpindleAngle& angle);
  void push(const CuttingCondition& condition);
  /// @param begin called at the goal's stamp with whether no other measurement runs; returns whether to
  /// start; may be empty
  void push(const MeasureFrfGoal& goal, std::function<bool(bool)> begin = {});
  /// A step of a calibration, at its stamp. @param begin as for the other goal
  void push(const CalibrationGoal& goal, std::function<bool(bool)> begin = {});
  /// Ends a running calibration measurement, at the stamp of the newest input.
  void cancelCalibration();
  const SpindleSensorCalibrator& calibrator() const { return calibrator_; }
  const PlateCalibrator& plate() const { return plate_; }
  /// Event without a stamp for the measurement, at the stamp of the newest input.
  void event(std::function<void(SensorMeasurement&)> action);
  /// Modes measured earlier (tool/modes of the force sensor). They are used from their stamp on, unless the
  /// same or later taps were measured here. Modes of other points are ignored.
  void push(const MeasuredModes& modes);
  /// The hammer's stream has ended: other streams no longer wait for it.
  void hammerStopped(const std::string& reason);
  /// End of data.
  void flush();

  CompensationHealth health() const;
  /// Channel of the force sensor whose samples have not changed for longest.
  const StuckChannel& stuck() const { return stuck_; }
  /// Model in use of an axis.
  const ModalModel& sensor(std::size_t axis) const { return compensation_.sensor(axis); }
  /// Age of the oldest measured modes in use, at the newest input [s]; 0 without measured modes.
  double ageOfModes() const;
  bool isMeasuring() const { return measurement_.active(); }
  std::string waitingFor() const { return sorter_.waitingFor(); }
  std::size_t late() const { return sorter_.late(); }
  /// @param callback called when stamps jump back (a recording was restarted); measured modes are dropped
  void onRestart(std::function<void()> callback) { on_restart_ = std::move(callback); }

 private:
  void check(const SampleBlock& block) const;
  void handle(const SampleBlock& block);
  void restart();
  void startUncalibrated();
  void publishResults();
  void publishCalibration();
  void applyCalibration(CalibrationResult result);
  void installMatrix(const TransferMatrix& matrix, double bandwidth);
  void setCalibration(const CalibrationResult& result);
  SampleBlock forcesOf(const SampleBlock& block);
  ForceOutputs blockOutputs();
  void useModelSensors();

  ForceSensor model_sensor_;
  Outputs outputs_;
  ForceCompensation compensation_;
  SensorMeasurement measurement_;
  StreamSorter sorter_;
  std::array<double, 3> modes_stamp_{};  // [s] of the measured modes in use, each axis
  StreamSorter::Stream conditions_, goals_, hammers_, angles_, blocks_;
  std::optional<MatrixCompensation> inverse_;
  std::optional<SpindleForceSensor> spindle_;
  std::optional<ForceSensorKind> kind_;
  SensorCalibrationState calibration_;
  bool calibrated_here_ = false;  // by goals: ends with a restart of the recording
  double spindle_length_ = 0.0;   // [m] 0: unknown
  std::optional<CuttingCondition> condition_;
  TapParameters taps_;
  SpindleSensorCalibrator calibrator_;
  PlateCalibrator plate_;
  double bandwidth_;  // [Hz] of a transfer matrix that is measured here
  std::optional<SensorMatrix> matrix_;
  InvalidSamples invalid_;
  StuckChannel stuck_;
  std::function<void()> on_restart_;
};

}  // namespace smartmill::kalman
