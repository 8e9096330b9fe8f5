#include "smartmill_kalman/compensation/compensation_pipeline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"

namespace smartmill::kalman {
namespace {

constexpr double NEVER = -std::numeric_limits<double>::infinity();

// A sample of the sensor that counts as clipped in a cut is none in a tap either.
TapParameters withRange(TapParameters taps, double saturation) {
  taps.response_range = saturation;
  return taps;
}

int axisOf(const std::string& direction) {
  return direction == "x" ? 0 : direction == "y" ? 1 : direction == "z" ? 2 : -1;
}

}  // namespace

CompensationPipeline::CompensationPipeline(const CompensationParameters& parameters,
                                           const TapParameters& taps, const ForceSensor& sensor,
                                           double hold_back, Outputs outputs)
    : believed_(sensor),
      outputs_(std::move(outputs)),
      compensation_(parameters, sensor.measures_workpiece,
                    [this](const ForceBlock& m, const ForceBlock& c) { forward(m, c); }),
      measurement_(withRange(taps, parameters.saturation)),
      sorter_(hold_back),
      conditions_(sorter_.addLatched(names::CUTTING_CONDITION)),
      goals_(sorter_.addEvents(names::MEASURE_SENSOR_FRF)),
      hammers_(sorter_.addOptional(names::HAMMER)),
      // A machine without a tachometer has no angles to wait for.
      angles_(parameters.track_speed ? sorter_.addUnawaited(names::SPINDLE_ANGLE)
                                     : sorter_.addRegular(names::SPINDLE_ANGLE)),
      blocks_(sorter_.addRegular(names::DYNAMOMETER)),
      taps_(withRange(taps, parameters.saturation)),
      calibrator_(taps_, SpindleSensorCalibration::table3()),
      plate_(taps_),
      bandwidth_(parameters.filter.bandwidth) {
  useModelFile();
  sorter_.onRestart([this] {
    compensation_.reset();
    measurement_.reset();
    if (spindle_) spindle_->reset();
    if (inverse_) inverse_->reset();
    calibrator_.reset();
    plate_.reset();
    condition_.reset();
    invalid_.clear();
    useModelFile();
    if (restarted_) restarted_();
  });
}

void CompensationPipeline::useSpindleSensor(const SpindleSensorCalibration& calibration, double length) {
  spindle_length_ = length;
  spindle_.emplace(calibration, length);
  calibrator_ = SpindleSensorCalibrator(taps_, calibration);
}

void CompensationPipeline::useTransferMatrix(const TransferMatrix& matrix, double bandwidth) {
  inverse_.emplace(MatrixInverse(matrix, bandwidth), believed_.measures_workpiece,
                   [this](const ForceBlock& m, const ForceBlock& c) { forward(m, c); });
}

void CompensationPipeline::useModelFile() {
  identified_.fill(NEVER);
  if (matrix_) {
    compensation_.setMatrix(*matrix_);
    for (std::size_t axis = 0; axis < 3; ++axis) believed_.axis[axis] = matrix_->h[axis][axis];
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (believed_.noise_rms) {
      compensation_.setSensor(axis, believed_.axis[axis], (*believed_.noise_rms)[axis]);
    } else {
      compensation_.setSensor(axis, believed_.axis[axis]);
    }
  }
}

void CompensationPipeline::push(SampleBlock block) {
  const double stamp = block.stamp;
  sorter_.push(blocks_, stamp, [this, block = std::move(block)] {
    if (SpindleForceSensor::isSixChannels(block)) {
      calibrator_.handle(block);
      drainCalibration();
      if (uncalibrated()) return;
      const SampleBlock forces = toForces(block);
      compensation_.handle(forces);
      measurement_.handleSensor(forces);
    } else {
      if (inverse_) {
        inverse_->handle(block);
      } else {
        compensation_.handle(block);
      }
      plate_.handle(block);
      measurement_.handleSensor(block);
    }
    drain();
  });
}

SampleBlock CompensationPipeline::toForces(const SampleBlock& block) {
  if (!spindle_) throw Error("six channels of a spindle's force sensor, but no calibration (spindle_sensor)");
  for (std::size_t axis = 0; axis < 3; ++axis) spindle_->setSensor(axis, compensation_.sensor(axis));
  SampleBlock forces = spindle_->handle(block);
  const std::vector<bool>& invalid = spindle_->invalid();
  for (std::size_t i = 0; spindle_->anyInvalid() && i < invalid.size(); ++i) {
    const std::uint64_t index = block.first_index + i;
    if (!invalid[i]) continue;
    if (!invalid_.empty() && invalid_.back().second == index) {
      ++invalid_.back().second;
    } else {
      invalid_.emplace_back(index, index + 1);
    }
  }
  return forces;
}

// The filters bridge what was not measured; where the sensor could not measure nothing is claimed.
void CompensationPipeline::forward(const ForceBlock& measured, const ForceBlock& compensated) {
  if (!outputs_.force) return;
  if (!spindle_) {
    outputs_.force(measured, compensated);
    return;
  }
  ForceBlock shown = measured, marked = compensated;
  const std::uint64_t begin = marked.first_index, end = begin + marked.force[0].size();
  while (!invalid_.empty() && invalid_.front().second <= std::min(begin, shown.first_index))
    invalid_.pop_front();
  for (const auto& [from, to] : invalid_) {
    for (std::uint64_t i = std::max(from, begin); i < std::min(to, end); ++i) {
      for (auto& force : marked.force) force[i - begin] = NOT_A_NUMBER;
    }
  }
  spindle_->lowPass(shown);
  outputs_.force(shown, marked);
}

void CompensationPipeline::pushHammer(SampleBlock block) {
  const double stamp = block.stamp;
  sorter_.push(hammers_, stamp, [this, block = std::move(block)] {
    calibrator_.handleHammer(block);
    plate_.handleHammer(block);
    measurement_.handleHammer(block);
    drain();
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
    const bool wanted = !begin || begin(free);  // before the goal's own results
    if (free && wanted) {
      if (spindle_) {
        calibrator_.tapping(goal.direction, spindle_length_);
      } else {
        plate_.tapping(goal.direction);
      }
      measurement_.handle(goal);
    }
    drain();
  });
}

void CompensationPipeline::push(const CalibrationGoal& goal, std::function<bool(bool)> begin) {
  sorter_.push(goals_, goal.stamp, [this, goal, begin = std::move(begin)] {
    const bool free = !calibrator_.active();
    const bool wanted = !begin || begin(free);
    using Step = CalibrationGoal::Step;
    const bool plate = goal.step == Step::point || (goal.step == Step::fit && !plate_.taps().taps.empty());
    if (goal.step == Step::forget) plate_.reset();
    if (free && wanted && plate) {
      serve(plate_.handle(goal));
    } else if (free && wanted) {
      calibrator_.handle(goal);
    }
    drainCalibration();
  });
}

void CompensationPipeline::cancelCalibration() {
  sorter_.pushNow(goals_, [this] {
    calibrator_.cancel();
    drainCalibration();
  });
}

void CompensationPipeline::drainCalibration() {
  if (auto result = calibrator_.takeResult()) serve(std::move(*result));
}

void CompensationPipeline::serve(CalibrationResult result) {
  if (result.matrix) {
    try {
      useTransferMatrix(*result.matrix, bandwidth_);
    } catch (const Error& e) {
      result.message += std::string("; it does not serve here: ") + e.what();
    }
  }
  if (result.calibration && spindle_length_ > 0.0) {
    // What was found serves from now on; the zero is learnt anew.
    try {
      spindle_.emplace(*result.calibration, spindle_length_);
      if (condition_) spindle_->handle(*condition_);
    } catch (const Error& e) {
      result.message += std::string("; it does not serve here: ") + e.what();
    }
  }
  if (outputs_.calibration) outputs_.calibration(result);
}

void CompensationPipeline::event(std::function<void(SensorMeasurement&)> what) {
  sorter_.pushNow(goals_, [this, what = std::move(what)] {
    what(measurement_);
    drain();
  });
}

void CompensationPipeline::push(const MeasuredModes& modes) {
  const int found = axisOf(modes.direction);
  if (modes.point != POINT_FORCE_SENSOR || found < 0) return;
  sorter_.push(goals_, modes.stamp, [this, modes, axis = static_cast<std::size_t>(found)] {
    if (modes.stamp <= identified_[axis]) return;
    identified_[axis] = modes.stamp;
    compensation_.setSensor(axis, modes.model);
  });
}

double CompensationPipeline::modesAge() const {
  double age = 0.0;
  for (const double stamp : identified_) {
    if (std::isfinite(stamp)) age = std::max(age, sorter_.newest() - stamp);
  }
  return age;
}

void CompensationPipeline::hammerLost(const std::string& text) {
  if (measurement_.active()) {
    measurement_.lost(text);
    drain();
  }
  sorter_.setRegular(hammers_, false);
}

void CompensationPipeline::drain() {
  if (const auto command = measurement_.takeCommand(); command && outputs_.strike) outputs_.strike(*command);
  if (const auto feedback = measurement_.takeFeedback(); feedback && outputs_.feedback)
    outputs_.feedback(*feedback);
  if (const auto result = measurement_.takeResult()) {
    calibrator_.tapped(*result);
    plate_.tapped(*result);
    if (result->code == FrfCode::ok) {
      const auto axis = static_cast<std::size_t>(axisOf(result->modes.direction));
      identified_[axis] = result->modes.stamp;
      // A record without any noise says nothing about the sensor's.
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
