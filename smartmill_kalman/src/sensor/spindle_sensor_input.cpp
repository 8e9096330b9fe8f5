#include "smartmill_kalman/sensor/spindle_sensor_input.h"

#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::kalman {

void SpindleSensorInput::use(const SpindleSensorCalibration& calibration, double length) {
  length_ = length;
  sensor_.emplace(calibration, length);
}

void SpindleSensorInput::recalibrate(const SpindleSensorCalibration& calibration) {
  if (!(length_ > 0.0)) return;
  SpindleForceSensor recalibrated(calibration, length_);
  if (sensor_) recalibrated.keepUnbalance(*sensor_);
  if (condition_) recalibrated.handle(*condition_);
  sensor_ = std::move(recalibrated);
}

void SpindleSensorInput::check(const SampleBlock& block) const {
  SpindleForceSensor::columnsOf(block);
  if (!sensor_ && !uncalibrated_allowed_)
    throw Error("spindle_sensor: not set, expected a calibration for a sensor of six channels");
}

void SpindleSensorInput::handle(const SpindleAngle& angle) {
  if (sensor_) sensor_->handle(angle);
}

void SpindleSensorInput::handle(const CuttingCondition& condition) {
  condition_ = condition;
  if (sensor_) sensor_->handle(condition);
}

SampleBlock SpindleSensorInput::forces(const SampleBlock& block) {
  SampleBlock forces = sensor_->handle(block);
  if (sensor_->anyInvalid()) invalid_.add(block.first_index, sensor_->invalid());
  return forces;
}

void SpindleSensorInput::reset() {
  if (sensor_) sensor_->reset();
  condition_.reset();
  invalid_.clear();
}

}  // namespace smartmill::kalman
