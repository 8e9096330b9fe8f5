#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "smartmill_core/model/force_sensor_kind.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_kalman/compensation/force_compensation.h"
#include "smartmill_kalman/compensation/matrix_compensation.h"
#include "smartmill_kalman/sensor/spindle_sensor_input.h"

namespace smartmill::kalman {

/// From the blocks of the force sensor to force blocks, with the sensor in use: a filtered table sensor, a
/// sensor in the spindle (its forces are filtered), or one whose transfer matrix is inverted. Inputs in stamp
/// order.
class SensorForces {
 public:
  /// @param sensor of the machine model, for axes that are not measured. @throws Error.
  SensorForces(const CompensationParameters& parameters, const ForceSensor& sensor, ForceOutputs outputs);
  SensorForces(const SensorForces&) = delete;
  SensorForces& operator=(const SensorForces&) = delete;

  /// Kind of the sensor. Six sensors in the spindle and a plate give no force until they are calibrated.
  void useKind(ForceSensorKind kind);
  bool isPlate() const { return kind_ == ForceSensorKind::plate; }
  bool isUncalibrated() const;
  /// Neither a sensor in the spindle nor a matrix is in use from now on.
  void removeCalibration();
  /// Sensor of six channels x1 .. z2 in the spindle; invalid samples give NaN.
  SpindleSensorInput& spindle() { return spindle_; }
  const SpindleSensorInput& spindle() const { return spindle_; }
  /// Inverts the transfer matrix of a sensor of 3 or 6 channels instead of filtering. @throws Error.
  void useTransferMatrix(const TransferMatrix& matrix, double bandwidth);
  /// Sensor with cross-talk; its diagonal replaces the machine model's sensor.
  void useMatrix(const SensorMatrix& matrix);
  /// Measured modes of an axis are in use from now on. @param stamp [s] of the modes @param noise_rms [N];
  /// 0: unknown
  void setModes(std::size_t axis, double stamp, const ModalModel& model, double noise_rms = 0.0);
  /// Process noise over the spindle speed of a calibration file.
  void useMemory(const MemorySchedule& memory);
  /// The same, tuned here: from now on, until a restart.
  void setMemory(const MemorySchedule& memory) { compensation_.setMemory(memory); }
  const MemorySchedule& memory() const { return compensation_.memory(); }
  /// [s] of the measured modes in use; -infinity: those of the machine model
  double modesStamp(std::size_t axis) const { return modes_stamp_[axis]; }

  /// @throws Error when a block does not suit the sensor.
  void check(const SampleBlock& block) const;
  /// @return the sensor's forces (fx, fy, fz) of the block, valid until the next; null without a
  /// calibration. @throws Error as check(), or when the filters cannot be designed.
  const SampleBlock* handle(const SampleBlock& block);
  void handle(const SpindleAngle& angle);
  void handle(const CuttingCondition& condition);
  void handle(const CncState& state) { compensation_.handle(state); }
  /// End of data: pending blocks are published.
  void flush();
  /// A recording was restarted: as new, measured modes are dropped.
  void reset();

  CompensationHealth health() const;
  /// Force model in use and its reason, one line.
  std::string forceModel() const;
  /// Harmonics (or delay_form) by a spindle angle without ripple.
  bool hasDefaultForceModel() const { return inverse_ || compensation_.hasDefaultForceModel(); }
  /// Model in use of an axis.
  const ModalModel& sensor(std::size_t axis) const { return compensation_.sensor(axis); }
  bool invertsMatrix() const { return inverse_.has_value(); }

 private:
  ForceOutputs blockOutputs();
  void useModelSensors();

  ForceSensor model_sensor_;
  ForceOutputs outputs_;
  ForceCompensation compensation_;
  SpindleSensorInput spindle_;
  std::optional<ForceSensorKind> kind_;
  std::optional<MatrixCompensation> inverse_;
  std::optional<SensorMatrix> matrix_;
  MemorySchedule file_memory_;
  std::array<double, 3> modes_stamp_{};  // [s]
  SampleBlock spindle_forces_;           // of the last block
};

}  // namespace smartmill::kalman
