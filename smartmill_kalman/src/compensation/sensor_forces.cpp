#include "smartmill_kalman/compensation/sensor_forces.h"

#include <limits>
#include <utility>

namespace smartmill::kalman {
namespace {

constexpr double NEVER = -std::numeric_limits<double>::infinity();

}  // namespace

SensorForces::SensorForces(const CompensationParameters& parameters, const ForceSensor& sensor,
                           ForceOutputs outputs)
    : model_sensor_(sensor),
      outputs_(std::move(outputs)),
      compensation_(parameters, sensor.measures_workpiece, blockOutputs()) {
  useModelSensors();
}

void SensorForces::useKind(ForceSensorKind kind) {
  kind_ = kind;
  if (kind == ForceSensorKind::spindle) spindle_.allowUncalibrated();
}

bool SensorForces::isUncalibrated() const {
  return spindle_.isUncalibrated() || (isPlate() && !inverse_);
}

void SensorForces::removeCalibration() {
  spindle_.remove();
  inverse_.reset();
}

void SensorForces::useTransferMatrix(const TransferMatrix& matrix, double bandwidth) {
  inverse_.emplace(MatrixInverse(matrix, bandwidth), model_sensor_.measures_workpiece, blockOutputs());
}

void SensorForces::useMatrix(const SensorMatrix& matrix) {
  matrix_ = matrix;
  useModelSensors();
}

void SensorForces::useMemory(const MemorySchedule& memory) {
  file_memory_ = memory;
  setMemory(memory);
}

void SensorForces::useModelSensors() {
  modes_stamp_.fill(NEVER);
  if (matrix_) {
    compensation_.setMatrix(*matrix_);
    for (std::size_t axis = 0; axis < 3; ++axis) model_sensor_.axis[axis] = matrix_->h[axis][axis];
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (model_sensor_.noise_rms) {
      compensation_.setSensor(axis, model_sensor_.axis[axis], (*model_sensor_.noise_rms)[axis]);
    } else {
      compensation_.setSensor(axis, model_sensor_.axis[axis]);
    }
  }
}

void SensorForces::setModes(std::size_t axis, double stamp, const ModalModel& model, double noise_rms) {
  modes_stamp_[axis] = stamp;
  if (noise_rms > 0.0) {
    compensation_.setSensor(axis, model, noise_rms);
  } else {
    compensation_.setSensor(axis, model);
  }
}

void SensorForces::check(const SampleBlock& block) const {
  if (kind_ == ForceSensorKind::spindle || SpindleForceSensor::isSixChannels(block)) {
    spindle_.check(block);
  } else if (inverse_) {
    inverse_->check(block);
  } else {
    ForceCompensation::check(block);
  }
}

const SampleBlock* SensorForces::handle(const SampleBlock& block) {
  if (SpindleForceSensor::isSixChannels(block)) {
    if (!spindle_.isInUse()) return nullptr;
    for (std::size_t axis = 0; axis < 3; ++axis) spindle_.setSensor(axis, sensor(axis));
    spindle_forces_ = spindle_.forces(block);
    compensation_.handle(spindle_forces_);
    return &spindle_forces_;
  }
  if (inverse_) {
    inverse_->handle(block);
  } else if (!isPlate()) {
    compensation_.handle(block);
  }
  return &block;
}

void SensorForces::handle(const SpindleAngle& angle) {
  spindle_.handle(angle);
  compensation_.handle(angle);
}

void SensorForces::handle(const CuttingCondition& condition) {
  spindle_.handle(condition);
  compensation_.handle(condition);
}

void SensorForces::flush() {
  compensation_.flush();
  if (inverse_) inverse_->flush();
}

void SensorForces::reset() {
  compensation_.reset();
  spindle_.reset();
  if (inverse_) inverse_->reset();
  useModelSensors();
  setMemory(file_memory_);
}

ForceOutputs SensorForces::blockOutputs() {
  return {[this](const ForceBlock& measured) {
            if (!outputs_.measured) return;
            if (!spindle_.isInUse()) return outputs_.measured(measured);
            ForceBlock filtered = measured;
            spindle_.lowPass(filtered);
            outputs_.measured(filtered);
          },
          [this](const ForceBlock& compensated) {
            if (!outputs_.compensated) return;
            if (!spindle_.isInUse()) return outputs_.compensated(compensated);
            ForceBlock marked = compensated;
            spindle_.markInvalid(marked);
            outputs_.compensated(marked);
          }};
}

std::string SensorForces::forceModel() const {
  return inverse_ ? "inverse of the transfer matrix" : compensation_.forceModel();
}

CompensationHealth SensorForces::health() const {
  CompensationHealth health = compensation_.health();
  if (inverse_) {
    health.gaps += inverse_->gaps();
    health.not_finite += inverse_->notFinite();
  }
  return health;
}

}  // namespace smartmill::kalman
