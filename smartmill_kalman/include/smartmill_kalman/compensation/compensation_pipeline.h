#pragma once

#include <functional>
#include <optional>
#include <string>

#include "smartmill_core/model/force_sensor_kind.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_kalman/compensation/compensation_outputs.h"
#include "smartmill_kalman/compensation/sensor_forces.h"
#include "smartmill_kalman/compensation/sensor_identification.h"
#include "smartmill_kalman/sensor/channel_forces.h"
#include "smartmill_kalman/sensor/torque_check.h"

namespace smartmill::kalman {

/// The kalman node without ROS: puts its inputs into stamp order for SensorForces, which compensates the
/// force, and SensorIdentification, which measures or calibrates the sensor on request. The node and the
/// offline tool feed this class, so that both give the same numbers.
class CompensationPipeline {
 public:
  using Outputs = CompensationOutputs;

  /// @param sensor of the machine model, for axes that are not measured @param hold_back [s], see
  /// StreamSorter. @throws Error.
  CompensationPipeline(const CompensationParameters& parameters, const TapParameters& taps,
                       const ForceSensor& sensor, double hold_back, Outputs outputs);
  CompensationPipeline(const CompensationPipeline&) = delete;
  CompensationPipeline& operator=(const CompensationPipeline&) = delete;

  SensorForces& forces() { return forces_; }
  const SensorForces& forces() const { return forces_; }
  const SensorIdentification& identification() const { return identification_; }
  const StreamSorter& sorter() const { return sorter_; }
  /// Channels of the machine model's sensor; nullptr: its forces are measured.
  const ChannelForces* channels() const { return channels_ ? &*channels_ : nullptr; }
  /// Kind of the sensor. Six sensors in the spindle and a plate give no force until they are calibrated.
  void useKind(ForceSensorKind kind);
  /// Accepts blocks of six sensors in the spindle (channels x1 .. z2).
  /// @param length [m] of tool and holder. @throws Error.
  void useSpindleSensor(const SpindleSensorCalibration& calibration, double length);
  /// Inverts the transfer matrix of a sensor of 3 or 6 channels instead of filtering. @throws Error.
  void useTransferMatrix(const TransferMatrix& matrix, double bandwidth);
  /// Compares the forces with the load meter from now on; blocks that disagree are marked.
  void checkTorque(const Spindle& spindle) { torque_check_.emplace(spindle); }
  /// nullptr: not compared
  TorqueCheck* torqueCheck() { return torque_check_ ? &*torque_check_ : nullptr; }
  /// Age of the oldest measured modes in use, at the newest input [s]; 0 without measured modes.
  double ageOfModes() const;

  /// Block of the force sensor. @throws Error when it does not suit the sensor.
  void push(SampleBlock block);
  /// Block of the hammer, on machines that have one. @throws Error when the channel is missing or not in N.
  void pushHammer(SampleBlock block);
  void push(const SpindleAngle& angle);
  void push(const CuttingCondition& condition);
  /// State of the controller: its speed, for estimates without spindle/angle.
  void push(const CncState& state);
  /// Reading of the load meter, for checkTorque().
  void push(const LoadSample& sample);
  /// @param begin called at the goal's stamp with whether no other measurement runs; returns whether to
  /// start; may be empty
  void push(const MeasureFrfGoal& goal, std::function<bool(bool)> begin = {});
  /// A step of a calibration, at its stamp. @param begin as for the other goal
  void push(const CalibrationGoal& goal, std::function<bool(bool)> begin = {});
  /// Modes measured earlier (tool/modes of the force sensor). They are used from their stamp on, unless the
  /// same or later taps were measured here. Modes of other points are ignored.
  void push(const MeasuredModes& modes);
  /// Event without a stamp for the measurement, at the stamp of the newest input.
  void event(std::function<void(SensorMeasurement&)> action);
  /// Ends a running calibration measurement, at the stamp of the newest input.
  void cancelCalibration();
  /// The hammer's stream has ended: other streams no longer wait for it.
  void hammerStopped(const std::string& reason);
  /// Readings of the spindle no longer come while blocks do: with track_speed auto blocks do not wait for
  /// them until the next one. The choice of the speed does not depend on it.
  void anglesStopped();
  /// End of data.
  void flush();

 private:
  void handle(const SampleBlock& block);
  void restart();
  ForceOutputs checkedOutputs();

  Outputs outputs_;
  StreamSorter sorter_;
  SensorForces forces_;
  SensorIdentification identification_;
  std::function<void()> use_file_;  // the calibration of a file; empty: none
  std::optional<ChannelForces> channels_;
  std::optional<TorqueCheck> torque_check_;
  bool may_estimate_;  // the speed, where angles are missing
  StreamSorter::Stream conditions_, goals_, hammers_, angles_, blocks_, states_, loads_;
};

}  // namespace smartmill::kalman
