#pragma once

#include <cstddef>
#include <optional>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/compensation/invalid_samples.h"
#include "smartmill_kalman/sensor/spindle_force_sensor.h"

namespace smartmill::kalman {

/// The sensor in the spindle that is in use, if there is one: its calibration may be missing at first and
/// may be replaced while it runs. Forces of invalid samples are marked in the compensated blocks, which may
/// come later than the samples.
class SpindleSensorInput {
 public:
  /// @param length [m] of tool and holder. @throws Error when a constant is not positive there.
  void use(const SpindleSensorCalibration& calibration, double length);
  /// Another calibration at the length in use; the zero is estimated anew. Without a length: none in use.
  /// @throws Error as use()
  void recalibrate(const SpindleSensorCalibration& calibration);
  /// None in use from now on.
  void remove() { sensor_.reset(); }
  /// Length [m] of tool and holder for a calibration on the machine.
  void setLength(double length) { length_ = length; }
  double length() const { return length_; }  ///< [m] 0: unknown
  /// Six sensors without a calibration are accepted and give no force until they are calibrated.
  void allowUncalibrated() { uncalibrated_allowed_ = true; }
  bool isUncalibrated() const { return uncalibrated_allowed_ && !sensor_; }
  bool isInUse() const { return sensor_.has_value(); }
  /// @return null without a sensor in the spindle.
  const SpindleSensorHealth* health() const { return sensor_ ? &sensor_->health() : nullptr; }

  /// @throws Error when a channel is missing or not in N, or without a calibration.
  void check(const SampleBlock& block) const;
  void handle(const SpindleAngle& angle);
  void handle(const CuttingCondition& condition);
  /// Dynamics of an axis (measured over applied, static gain 1) that the unbalance force passes.
  void setSensor(std::size_t axis, const ModalModel& sensor) { sensor_->setSensor(axis, sensor); }
  /// Forces fx, fy, fz of a block of six sensors, with a sensor in use.
  SampleBlock forces(const SampleBlock& block);
  void reset();

  /// The low-pass of the calibration on a measured block.
  void lowPass(ForceBlock& measured) { sensor_->lowPass(measured); }
  /// NaN at the invalid samples of a compensated block; the filters have predicted over them.
  void markInvalid(ForceBlock& compensated) { invalid_.apply(compensated); }

 private:
  std::optional<SpindleForceSensor> sensor_;
  std::optional<CuttingCondition> condition_;
  InvalidSamples invalid_;
  bool uncalibrated_allowed_ = false;
  double length_ = 0.0;  // [m] 0: unknown
};

}  // namespace smartmill::kalman
