#include "smartmill_kalman/compensation/compensation_pipeline.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_kalman/sensor/block_channels.h"

namespace smartmill::kalman {
namespace {

// A sample that counts as clipped in a cut also counts as clipped in a tap.
TapParameters withRange(TapParameters taps, double saturation) {
  taps.response_range = saturation;
  return taps;
}

// Where the speed can be estimated, blocks do not wait for angles that are missing.
StreamSorter::Stream addAngles(StreamSorter& sorter, const CompensationParameters& parameters) {
  if (parameters.track_speed.isAlways()) return sorter.addUnawaited(names::SPINDLE_ANGLE);
  if (parameters.track_speed.isAuto())
    return sorter.addRegular(names::SPINDLE_ANGLE, parameters.angle_patience);
  return sorter.addRegular(names::SPINDLE_ANGLE);
}

}  // namespace

CompensationPipeline::CompensationPipeline(const CompensationParameters& parameters,
                                           const TapParameters& taps, const ForceSensor& sensor,
                                           double hold_back, Outputs outputs)
    : outputs_(std::move(outputs)),
      sorter_(hold_back),
      forces_(parameters, sensor, checkedOutputs()),
      identification_(withRange(taps, parameters.saturation), parameters.filter, forces_, sorter_, outputs_),
      may_estimate_(parameters.track_speed.isAuto()),
      conditions_(sorter_.addLatched(names::CUTTING_CONDITION)),
      goals_(sorter_.addEvents(names::MEASURE_SENSOR_FRF)),
      hammers_(sorter_.addOptional(names::HAMMER)),
      angles_(addAngles(sorter_, parameters)),
      blocks_(sorter_.addRegular(names::DYNAMOMETER)),
      states_(sorter_.addEvents(names::CNC_STATE)),
      loads_(sorter_.addEvents(names::CNC_LOAD)) {
  if (sensor.channels) channels_.emplace(*sensor.channels);
  sorter_.onRestart([this] { restart(); });
}

void CompensationPipeline::restart() {
  identification_.reset();
  forces_.reset();
  if (torque_check_) torque_check_->reset();
  if (use_file_) use_file_();
  if (outputs_.restart) outputs_.restart();
}

ForceOutputs CompensationPipeline::checkedOutputs() {
  return {[this](const ForceBlock& measured) {
            if (torque_check_) torque_check_->handle(measured, forces_.health().zero);
            if (outputs_.force.measured) outputs_.force.measured(measured);
          },
          [this](const ForceBlock& compensated) {
            if (!outputs_.force.compensated) return;
            if (!torque_check_ || !torque_check_->disagrees()) return outputs_.force.compensated(compensated);
            ForceBlock marked = compensated;
            marked.status = ForceBlock::Status::implausible;
            outputs_.force.compensated(marked);
          }};
}

void CompensationPipeline::useKind(ForceSensorKind kind) {
  forces_.useKind(kind);
  identification_.startUncalibrated();
}

void CompensationPipeline::useSpindleSensor(const SpindleSensorCalibration& calibration, double length) {
  use_file_ = [this, calibration, length] {
    forces_.spindle().use(calibration, length);
    forces_.useMemory(calibration.memory);
    identification_.use(calibration, length);
  };
  use_file_();
}

void CompensationPipeline::useTransferMatrix(const TransferMatrix& matrix, double bandwidth) {
  use_file_ = [this, matrix, bandwidth] { identification_.use(matrix, bandwidth); };
  use_file_();
}

double CompensationPipeline::ageOfModes() const {
  double age = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double stamp = forces_.modesStamp(axis);
    if (std::isfinite(stamp)) age = std::max(age, sorter_.newest() - stamp);
  }
  return age;
}

// Checked before it waits in the sorter: an error belongs to the topic of the block, not to that of the input
// that releases it.
void CompensationPipeline::push(SampleBlock channels) {
  const bool combines = channels_ && channels_->isOf(channels);
  SampleBlock block = combines ? channels_->forces(channels) : std::move(channels);
  forces_.check(block);
  const double stamp = block.stamp;
  sorter_.push(blocks_, stamp, [this, block = std::move(block)] {
    try {
      handle(block);
    } catch (const Error& error) {
      if (!outputs_.block_error) throw;
      outputs_.block_error(error.what());
    }
    identification_.publishResults();
  });
}

void CompensationPipeline::handle(const SampleBlock& block) {
  identification_.handleChannels(block);
  if (const SampleBlock* forces = forces_.handle(block)) identification_.handleForces(*forces);
}

void CompensationPipeline::pushHammer(SampleBlock block) {
  columnOf(block, "hammer", "N");
  const double stamp = block.stamp;
  sorter_.push(hammers_, stamp, [this, block = std::move(block)] { identification_.handleHammer(block); });
}

void CompensationPipeline::push(const SpindleAngle& reading) {
  SpindleAngle angle = reading;
  // At rest a pulse tachometer gives no angle, and no force depends on it.
  if (std::isnan(angle.angle)) angle.angle = 0.0;
  sorter_.push(angles_, angle.stamp, [this, angle] {
    forces_.handle(angle);
    identification_.handle(angle);
  });
}

void CompensationPipeline::push(const CuttingCondition& condition) {
  sorter_.push(conditions_, condition.stamp, [this, condition] {
    forces_.handle(condition);
    if (torque_check_) torque_check_->handle(condition);
    identification_.handle(condition);
  });
}

void CompensationPipeline::push(const CncState& state) {
  sorter_.push(states_, state.stamp, [this, state] {
    forces_.handle(state);
    if (torque_check_) torque_check_->handle(state);
  });
}

void CompensationPipeline::push(const LoadSample& sample) {
  if (!torque_check_) return;
  sorter_.push(loads_, sample.stamp, [this, sample] { torque_check_->handle(sample); });
}

void CompensationPipeline::push(const MeasureFrfGoal& goal, std::function<bool(bool)> begin) {
  sorter_.push(goals_, goal.stamp,
               [this, goal, begin = std::move(begin)] { identification_.start(goal, begin); });
}

void CompensationPipeline::push(const CalibrationGoal& goal, std::function<bool(bool)> begin) {
  sorter_.push(goals_, goal.stamp,
               [this, goal, begin = std::move(begin)] { identification_.start(goal, begin); });
}

void CompensationPipeline::push(const MeasuredModes& modes) {
  const std::optional<std::size_t> found = axisIndex(modes.direction);
  if (modes.point != POINT_FORCE_SENSOR || !found) return;
  sorter_.push(goals_, modes.stamp, [this, modes, axis = *found] {
    if (modes.stamp > forces_.modesStamp(axis)) forces_.setModes(axis, modes.stamp, modes.model);
  });
}

void CompensationPipeline::event(std::function<void(SensorMeasurement&)> action) {
  sorter_.pushNow(goals_, [this, action = std::move(action)] { identification_.event(action); });
}

void CompensationPipeline::cancelCalibration() {
  sorter_.pushNow(goals_, [this] { identification_.cancelCalibration(); });
}

void CompensationPipeline::hammerStopped(const std::string& reason) {
  if (identification_.isMeasuring()) {
    identification_.event(
        [&reason](SensorMeasurement& measurement) { measurement.end(FrfCode::bad_data, reason); });
  }
  sorter_.setRegular(hammers_, false);
}

void CompensationPipeline::anglesStopped() {
  if (may_estimate_) sorter_.setRegular(angles_, false);
}

void CompensationPipeline::flush() {
  sorter_.flush();
  forces_.flush();
}

}  // namespace smartmill::kalman
