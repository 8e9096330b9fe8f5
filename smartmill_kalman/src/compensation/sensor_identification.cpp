#include "smartmill_kalman/compensation/sensor_identification.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"

namespace smartmill::kalman {

SensorIdentification::SensorIdentification(const TapParameters& taps, const HarmonicFilterParameters& filter,
                                           SensorForces& forces, const StreamSorter& sorter,
                                           const CompensationOutputs& outputs)
    : taps_(taps),
      filter_(filter),
      forces_(forces),
      sorter_(sorter),
      outputs_(outputs),
      measurement_(taps),
      calibrator_(taps, SpindleSensorCalibration::table3()),
      plate_(taps, filter.bandwidth) {
}

void SensorIdentification::use(const SpindleSensorCalibration& calibration, double length) {
  calibrator_ = SpindleSensorCalibrator(taps_, calibration);
  setCalibration(SpindleSensorCalibrator::describe(calibration, length));
}

void SensorIdentification::use(const TransferMatrix& matrix, double bandwidth) {
  install(matrix, bandwidth);
  setCalibration(plate_.describe());
}

void SensorIdentification::install(const TransferMatrix& matrix, double bandwidth) {
  forces_.useTransferMatrix(matrix, bandwidth);
  plate_.use(matrix, bandwidth);
}

void SensorIdentification::startUncalibrated() {
  calibration_ = {};
  calibration_.calibrated = !forces_.isUncalibrated();
  calibration_.message =
      calibration_.calibrated
          ? "modes of the machine model, until taps have measured them"
          : "not calibrated: no force is published until kalman/calibrate has ended step FIT";
}

void SensorIdentification::setCalibration(const CalibrationResult& result) {
  SensorCalibrationState& state = calibration_;
  state.calibrated = !forces_.isUncalibrated();
  state.message = result.message;
  state.stamp = std::max(0.0, sorter_.newest());  // 0 before any input
  state.readings = result.readings;
  state.verified = result.verified;
  state.error = result.error;
  if (result.verified) return;  // the constants stay
  state.constant = result.constant;
  state.constant_std = result.constant_std;
}

void SensorIdentification::handleChannels(const SampleBlock& block) {
  if (!SpindleForceSensor::isSixChannels(block)) return plate_.handle(block);
  calibrator_.handle(block);
  publishCalibration();
}

void SensorIdentification::handleForces(const SampleBlock& forces) {
  measurement_.handleSensor(forces);
  tuning_.handle(forces);
}

void SensorIdentification::handleHammer(const SampleBlock& block) {
  calibrator_.handleHammer(block);
  plate_.handleHammer(block);
  measurement_.handleHammer(block);
  publishResults();
}

void SensorIdentification::start(const MeasureFrfGoal& goal, const std::function<bool(bool)>& begin) {
  const bool free = !measurement_.active();
  const bool start = !begin || begin(free);  // before any result of the goal
  if (free && start) {
    if (forces_.spindle().isInUse()) {
      calibrator_.beginTaps(goal.direction, forces_.spindle().length());
    } else {
      plate_.beginTaps(goal.direction);
    }
    measurement_.handle(goal);
  }
  publishResults();
}

void SensorIdentification::start(const CalibrationGoal& goal, const std::function<bool(bool)>& begin) {
  const bool free = !calibrator_.active();
  const bool start = !begin || begin(free);
  using Step = CalibrationGoal::Step;
  const bool plate =
      goal.step == Step::point || (goal.step != Step::measurement && goal.step != Step::forget &&
                                   (forces_.isPlate() || !plate_.taps().taps.empty()));
  if (goal.step == Step::forget) {
    plate_.reset();
    tuning_.reset();
  }
  if (free && start && plate) {
    apply(plate_.handle(goal));
  } else if (free && start) {
    calibrator_.handle(goal);
  }
  auto result = calibrator_.takeResult();
  if (!result) return;
  if (goal.step == Step::fit) tune(*result);
  apply(std::move(*result));
}

// A sensor without readings (a table sensor, or one calibrated earlier) is only tuned.
void SensorIdentification::tune(CalibrationResult& result) {
  const std::vector<TuningRecord> records = tuning_.records();
  if (records.empty() || forces_.invertsMatrix()) return;
  std::array<SensorAxis, 3> sensor;
  for (std::size_t axis = 0; axis < 3; ++axis) sensor[axis] = {forces_.sensor(axis), filter_.noise_rms};
  MemorySchedule memory;
  try {
    for (const TuningRecord& record : records) {
      const std::array<TunedMemory, 3> tuned = tuneMemory(record, sensor, filter_);
      for (std::size_t axis = 0; axis < 3; ++axis) memory.axis[axis].push_back(tuned[axis]);
    }
  } catch (const Error& e) {
    result.message += std::string("; not tuned: ") + e.what();
    return;
  }
  if (!calibrator_.hasMeasurements()) {
    result.code = CalibrationResult::Code::ok;
    result.message = describe(memory);
  } else {
    result.message += "; " + describe(memory);
  }
  forces_.setMemory(memory);
  calibrator_.setMemory(memory);
  if (result.calibration) result.calibration->memory = memory;
  result.memory = std::move(memory);
}

void SensorIdentification::cancelCalibration() {
  calibrator_.cancel();
  publishCalibration();
}

void SensorIdentification::event(const std::function<void(SensorMeasurement&)>& action) {
  action(measurement_);
  publishResults();
}

void SensorIdentification::publishCalibration() {
  if (auto result = calibrator_.takeResult()) apply(std::move(*result));
}

void SensorIdentification::apply(CalibrationResult result) {
  bool changed = result.verified;
  try {
    if (result.matrix) {
      install(*result.matrix, filter_.bandwidth);
      changed = calibrated_here_ = true;
    }
    if (const double length = forces_.spindle().length(); result.calibration && length > 0.0) {
      forces_.spindle().recalibrate(*result.calibration);
      const CalibrationResult here = SpindleSensorCalibrator::describe(*result.calibration, length);
      result.constant = here.constant;
      result.constant_std = here.constant_std;
      result.error = here.error;
      changed = calibrated_here_ = true;
    }
  } catch (const Error& e) {
    result.message += std::string("; not in use: ") + e.what();
  }
  if (changed) setCalibration(result);
  if (outputs_.calibration) outputs_.calibration(result);
}

void SensorIdentification::publishResults() {
  if (const auto command = measurement_.takeCommand(); command && outputs_.strike) outputs_.strike(*command);
  if (const auto feedback = measurement_.takeFeedback(); feedback && outputs_.feedback)
    outputs_.feedback(*feedback);
  const auto result = measurement_.takeResult();
  if (!result) return;
  calibrator_.endTaps(*result);
  plate_.endTaps(*result);
  if (result->code == FrfCode::ok) {
    forces_.setModes(*axisIndex(result->modes.direction), result->modes.stamp, result->modes.model,
                     result->noise_rms);
  }
  if (outputs_.result) outputs_.result(*result);
}

void SensorIdentification::reset() {
  measurement_.reset();
  calibrator_.reset();
  plate_.reset();
  tuning_.reset();
  if (!std::exchange(calibrated_here_, false)) return;
  forces_.removeCalibration();
  startUncalibrated();
}

}  // namespace smartmill::kalman
