#include "smartmill_kalman/compensation/compensation_pipeline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_kalman/sensor/block_channels.h"

namespace smartmill::kalman {
namespace {

constexpr double NEVER = -std::numeric_limits<double>::infinity();

// A sample that counts as clipped in a cut also counts as clipped in a tap.
TapParameters withRange(TapParameters taps, double saturation) {
  taps.response_range = saturation;
  return taps;
}

}  // namespace

CompensationPipeline::CompensationPipeline(const CompensationParameters& parameters,
                                           const TapParameters& taps, const ForceSensor& sensor,
                                           double hold_back, Outputs outputs)
    : model_sensor_(sensor),
      outputs_(std::move(outputs)),
      compensation_(parameters, sensor.measures_workpiece, blockOutputs()),
      measurement_(withRange(taps, parameters.saturation)),
      sorter_(hold_back),
      conditions_(sorter_.addLatched(names::CUTTING_CONDITION)),
      goals_(sorter_.addEvents(names::MEASURE_SENSOR_FRF)),
      hammers_(sorter_.addOptional(names::HAMMER)),
      // Without a tachometer there are no angles to wait for.
      angles_(parameters.track_speed ? sorter_.addUnawaited(names::SPINDLE_ANGLE)
                                     : sorter_.addRegular(names::SPINDLE_ANGLE)),
      blocks_(sorter_.addRegular(names::DYNAMOMETER)),
      taps_(withRange(taps, parameters.saturation)),
      calibrator_(taps_, SpindleSensorCalibration::table3()),
      plate_(taps_, parameters.filter.bandwidth),
      bandwidth_(parameters.filter.bandwidth) {
  useModelSensors();
  sorter_.onRestart([this] { restart(); });
}

void CompensationPipeline::restart() {
  compensation_.reset();
  measurement_.reset();
  if (spindle_) spindle_->reset();
  if (inverse_) inverse_->reset();
  calibrator_.reset();
  plate_.reset();
  if (std::exchange(calibrated_here_, false)) {
    spindle_.reset();
    inverse_.reset();
    startUncalibrated();
  }
  condition_.reset();
  invalid_.clear();
  useModelSensors();
  if (on_restart_) on_restart_();
}

void CompensationPipeline::useKind(ForceSensorKind kind) {
  kind_ = kind;
  startUncalibrated();
}

void CompensationPipeline::startUncalibrated() {
  calibration_ = {};
  calibration_.calibrated = !isUncalibrated();
  calibration_.message =
      calibration_.calibrated
          ? "modes of the machine model, until taps have measured them"
          : "not calibrated: no force is published until kalman/calibrate has ended step FIT";
}

bool CompensationPipeline::isUncalibrated() const {
  return (kind_ == ForceSensorKind::spindle && !spindle_) || (kind_ == ForceSensorKind::plate && !inverse_);
}

void CompensationPipeline::useSpindleSensor(const SpindleSensorCalibration& calibration, double length) {
  spindle_length_ = length;
  spindle_.emplace(calibration, length);
  calibrator_ = SpindleSensorCalibrator(taps_, calibration);
  setCalibration(SpindleSensorCalibrator::describe(calibration, length));
}

void CompensationPipeline::useTransferMatrix(const TransferMatrix& matrix, double bandwidth) {
  installMatrix(matrix, bandwidth);
  setCalibration(plate_.describe());
}

void CompensationPipeline::installMatrix(const TransferMatrix& matrix, double bandwidth) {
  inverse_.emplace(MatrixInverse(matrix, bandwidth), model_sensor_.measures_workpiece, blockOutputs());
  plate_.use(matrix, bandwidth);
}

void CompensationPipeline::useModelSensors() {
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

// Checked before it waits in the sorter: an error belongs to the topic of the block, not to that of the input
// that releases it.
void CompensationPipeline::check(const SampleBlock& block) const {
  if (kind_ == ForceSensorKind::spindle || SpindleForceSensor::isSixChannels(block)) {
    SpindleForceSensor::columnsOf(block);
    if (!spindle_ && kind_ != ForceSensorKind::spindle)
      throw Error("spindle_sensor: not set, expected a calibration for a sensor of six channels");
  } else if (inverse_) {
    inverse_->check(block);
  } else {
    ForceCompensation::check(block);
  }
}

void CompensationPipeline::push(SampleBlock block) {
  check(block);
  const double stamp = block.stamp;
  sorter_.push(blocks_, stamp, [this, block = std::move(block)] {
    try {
      handle(block);
    } catch (const Error& error) {
      if (!outputs_.block_error) throw;
      outputs_.block_error(error.what());
    }
    publishResults();
  });
}

void CompensationPipeline::handle(const SampleBlock& block) {
  stuck_.handle(block);
  if (SpindleForceSensor::isSixChannels(block)) {
    calibrator_.handle(block);
    publishCalibration();
    if (!spindle_) return;
    const SampleBlock forces = forcesOf(block);
    compensation_.handle(forces);
    measurement_.handleSensor(forces);
    return;
  }
  if (inverse_) {
    inverse_->handle(block);
  } else if (kind_ != ForceSensorKind::plate) {
    compensation_.handle(block);
  }
  plate_.handle(block);
  measurement_.handleSensor(block);
}

SampleBlock CompensationPipeline::forcesOf(const SampleBlock& block) {
  for (std::size_t axis = 0; axis < 3; ++axis) spindle_->setSensor(axis, compensation_.sensor(axis));
  SampleBlock forces = spindle_->handle(block);
  if (spindle_->anyInvalid()) invalid_.add(block.first_index, spindle_->invalid());
  return forces;
}

// The filters predict over invalid samples; their forces are published as NaN.
ForceOutputs CompensationPipeline::blockOutputs() {
  return {[this](const ForceBlock& measured) {
            if (!outputs_.force.measured) return;
            if (!spindle_) return outputs_.force.measured(measured);
            ForceBlock filtered = measured;
            spindle_->lowPass(filtered);
            outputs_.force.measured(filtered);
          },
          [this](const ForceBlock& compensated) {
            if (!outputs_.force.compensated) return;
            if (!spindle_) return outputs_.force.compensated(compensated);
            ForceBlock marked = compensated;
            invalid_.apply(marked);
            outputs_.force.compensated(marked);
          }};
}

void CompensationPipeline::pushHammer(SampleBlock block) {
  columnOf(block, "hammer", "N");
  const double stamp = block.stamp;
  sorter_.push(hammers_, stamp, [this, block = std::move(block)] {
    calibrator_.handleHammer(block);
    plate_.handleHammer(block);
    measurement_.handleHammer(block);
    publishResults();
  });
}

void CompensationPipeline::push(const SpindleAngle& angle) {
  sorter_.push(angles_, angle.stamp, [this, angle] {
    if (spindle_) spindle_->handle(angle);
    compensation_.handle(angle);
  });
}

void CompensationPipeline::push(const CuttingCondition& condition) {
  sorter_.push(conditions_, condition.stamp, [this, condition] {
    condition_ = condition;
    if (spindle_) spindle_->handle(condition);
    compensation_.handle(condition);
  });
}

void CompensationPipeline::push(const MeasureFrfGoal& goal, std::function<bool(bool)> begin) {
  sorter_.push(goals_, goal.stamp, [this, goal, begin = std::move(begin)] {
    const bool free = !measurement_.active();
    const bool start = !begin || begin(free);  // before any result of the goal
    if (free && start) {
      if (spindle_) {
        calibrator_.beginTaps(goal.direction, spindle_length_);
      } else {
        plate_.beginTaps(goal.direction);
      }
      measurement_.handle(goal);
    }
    publishResults();
  });
}

void CompensationPipeline::push(const CalibrationGoal& goal, std::function<bool(bool)> begin) {
  sorter_.push(goals_, goal.stamp, [this, goal, begin = std::move(begin)] {
    const bool free = !calibrator_.active();
    const bool start = !begin || begin(free);
    using Step = CalibrationGoal::Step;
    const bool plate =
        goal.step == Step::point || (goal.step != Step::measurement && goal.step != Step::forget &&
                                     (kind_ == ForceSensorKind::plate || !plate_.taps().taps.empty()));
    if (goal.step == Step::forget) plate_.reset();
    if (free && start && plate) {
      applyCalibration(plate_.handle(goal));
    } else if (free && start) {
      calibrator_.handle(goal);
    }
    publishCalibration();
  });
}

void CompensationPipeline::cancelCalibration() {
  sorter_.pushNow(goals_, [this] {
    calibrator_.cancel();
    publishCalibration();
  });
}

void CompensationPipeline::publishCalibration() {
  if (auto result = calibrator_.takeResult()) applyCalibration(std::move(*result));
}

void CompensationPipeline::applyCalibration(CalibrationResult result) {
  bool changed = result.verified;
  if (result.matrix) {
    try {
      installMatrix(*result.matrix, bandwidth_);
      changed = calibrated_here_ = true;
    } catch (const Error& e) {
      result.message += std::string("; not in use: ") + e.what();
    }
  }
  if (result.calibration && spindle_length_ > 0.0) {
    // The zero is estimated anew.
    try {
      spindle_.emplace(*result.calibration, spindle_length_);
      if (condition_) spindle_->handle(*condition_);
      const CalibrationResult here = SpindleSensorCalibrator::describe(*result.calibration, spindle_length_);
      result.constant = here.constant;
      result.constant_std = here.constant_std;
      result.error = here.error;
      changed = calibrated_here_ = true;
    } catch (const Error& e) {
      result.message += std::string("; not in use: ") + e.what();
    }
  }
  if (changed) setCalibration(result);
  if (outputs_.calibration) outputs_.calibration(result);
}

void CompensationPipeline::setCalibration(const CalibrationResult& result) {
  SensorCalibrationState& state = calibration_;
  state.calibrated = !isUncalibrated();
  state.message = result.message;
  state.stamp = std::max(0.0, sorter_.newest());  // 0 before any input
  state.readings = result.readings;
  state.verified = result.verified;
  state.error = result.error;
  if (result.verified) return;  // the constants stay
  state.constant = result.constant;
  state.constant_std = result.constant_std;
}

void CompensationPipeline::event(std::function<void(SensorMeasurement&)> action) {
  sorter_.pushNow(goals_, [this, action = std::move(action)] {
    action(measurement_);
    publishResults();
  });
}

void CompensationPipeline::push(const MeasuredModes& modes) {
  const std::optional<std::size_t> found = axisIndex(modes.direction);
  if (modes.point != POINT_FORCE_SENSOR || !found) return;
  sorter_.push(goals_, modes.stamp, [this, modes, axis = *found] {
    if (modes.stamp <= modes_stamp_[axis]) return;
    modes_stamp_[axis] = modes.stamp;
    compensation_.setSensor(axis, modes.model);
  });
}

void CompensationPipeline::flush() {
  sorter_.flush();
  compensation_.flush();
  if (inverse_) inverse_->flush();
}

CompensationHealth CompensationPipeline::health() const {
  CompensationHealth health = compensation_.health();
  if (inverse_) {
    health.gaps += inverse_->gaps();
    health.not_finite += inverse_->notFinite();
  }
  return health;
}

double CompensationPipeline::ageOfModes() const {
  double age = 0.0;
  for (const double stamp : modes_stamp_) {
    if (std::isfinite(stamp)) age = std::max(age, sorter_.newest() - stamp);
  }
  return age;
}

void CompensationPipeline::hammerStopped(const std::string& reason) {
  if (measurement_.active()) {
    measurement_.end(FrfCode::bad_data, reason);
    publishResults();
  }
  sorter_.setRegular(hammers_, false);
}

void CompensationPipeline::publishResults() {
  if (const auto command = measurement_.takeCommand(); command && outputs_.strike) outputs_.strike(*command);
  if (const auto feedback = measurement_.takeFeedback(); feedback && outputs_.feedback)
    outputs_.feedback(*feedback);
  if (const auto result = measurement_.takeResult()) {
    calibrator_.endTaps(*result);
    plate_.endTaps(*result);
    if (result->code == FrfCode::ok) {
      const std::size_t axis = *axisIndex(result->modes.direction);
      modes_stamp_[axis] = result->modes.stamp;
      // A record without noise gives no estimate of the sensor's noise.
      if (result->noise_rms > 0.0) {
        compensation_.setSensor(axis, result->modes.model, result->noise_rms);
      } else {
        compensation_.setSensor(axis, result->modes.model);
      }
    }
    if (outputs_.result) outputs_.result(*result);
  }
}

}  // namespace smartmill::kalman
