#include "smartmill_kalman/compensation/force_compensation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/coupled_compensation.h"
#include "smartmill_kalman/sensor/block_channels.h"

namespace smartmill::kalman {
namespace {

// The filters bridge single samples that are not measured by their prediction, but not a block of them.
bool isMeasured(const ForceBlock& block) {
  for (const std::vector<double>& force : block.force) {
    const auto finite = std::count_if(force.begin(), force.end(), [](double f) { return std::isfinite(f); });
    if (2 * static_cast<std::size_t>(finite) < force.size()) return false;
  }
  return true;
}

std::array<std::size_t, 3> forceColumns(const SampleBlock& block) {
  std::array<std::size_t, 3> column{};
  for (std::size_t axis = 0; axis < 3; ++axis) column[axis] = columnOf(block, FORCE_CHANNELS[axis], "N");
  return column;
}

}  // namespace

ForceCompensation::ForceCompensation(const CompensationParameters& parameters, bool measures_workpiece,
                                     ForceOutputs outputs)
    : parameters_((parameters.validate(), parameters)),
      sign_(measures_workpiece ? -1.0 : 1.0),
      outputs_(std::move(outputs)),
      chooser_(parameters),
      estimates_speed_(parameters.track_speed.isAlways()),
      method_(makeCompensationMethod(parameters.withSpeed(estimates_speed_), outputs_)),
      steady_speed_(parameters.speed_tolerance) {
}

void ForceCompensation::setSensor(std::size_t axis, const ModalModel& sensor, double noise_rms) {
  sensor_.at(axis) = SensorAxis{sensor, noise_rms};
  method_->setSensor(axis, *sensor_[axis]);
}

void ForceCompensation::setMatrix(const SensorMatrix& matrix) {
  matrix_ = matrix;
  for (std::size_t axis = 0; axis < 3; ++axis)
    sensor_[axis] = SensorAxis{matrix.h[axis][axis], parameters_.filter.noise_rms};
  makeMethod();
}

void ForceCompensation::makeMethod() {
  const CompensationParameters parameters = parameters_.withSpeed(estimates_speed_);
  std::unique_ptr<CompensationMethod> method;
  if (matrix_) {
    method = std::make_unique<CoupledCompensation>(parameters, *matrix_, outputs_);
  } else {
    method = makeCompensationMethod(parameters, outputs_);
  }
  method_->stop();
  method_ = std::move(method);
  method_->setMemory(memory_);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (sensor_[axis]) method_->setSensor(axis, *sensor_[axis]);
  }
  if (condition_) method_->beginCondition(*condition_);
}

void ForceCompensation::setMemory(const MemorySchedule& memory) {
  memory_ = memory;
  method_->setMemory(memory);
}

void ForceCompensation::handle(const SpindleAngle& angle) {
  chooser_.handle(angle);
  steady_speed_.add(angle);
  angle_ = angle;
}

void ForceCompensation::handle(const CncState& state) {
  chooser_.handle(state);
}

void ForceCompensation::handle(const CuttingCondition& condition) {
  method_->beginCondition(condition);
  condition_ = condition;
  chooser_.handle(condition);
  if (estimates_speed_) spindle_.speed = 0.0;  // the estimate starts again
}

bool ForceCompensation::takeSpeed(double stamp) {
  const ForceModelChoice& choice = chooser_.choose(stamp);
  const bool estimated = choice.speed == ForceModelChoice::Speed::estimated;
  const bool unknown = choice.speed == ForceModelChoice::Speed::unknown;
  // The estimate is limited around its start: where readings or controller have another speed, it starts
  // again.
  const double known =
      choice.reason == ForceModelChoice::Reason::ripple ? chooser_.startSpeed() : chooser_.controllerSpeed();
  const double limit = parameters_.tracker.max_deviations * parameters_.tracker.speed_std;
  const bool ends =
      estimates_speed_ && spindle_.speed > 0.0 && (unknown || std::abs(known / spindle_.speed - 1.0) > limit);
  if (ends || (!unknown && estimated != estimates_speed_)) {
    if (!unknown) estimates_speed_ = estimated;
    spindle_.speed = 0.0;
    makeMethod();
  }
  if (unknown) return false;
  if (!estimated) {
    spindle_ = angle_;
    return spindle_.speed >= parameters_.least_speed && steady_speed_.isSteadyAt(stamp);
  }
  if (spindle_.speed == 0.0) spindle_.speed = chooser_.startSpeed();
  return spindle_.speed >= parameters_.least_speed;
}

void ForceCompensation::reset() {
  method_->reset();
  steady_speed_.reset();
  chooser_.reset();
  next_index_.reset();
  spindle_.speed = angle_.speed = 0.0;
  condition_.reset();
  health_ = {};
}

bool ForceCompensation::hasDynamics() const {
  const auto known = [](const auto& axis) { return axis.has_value(); };
  return std::all_of(sensor_.begin(), sensor_.end(), known) &&
         std::any_of(sensor_.begin(), sensor_.end(), [](const auto& axis) {
           return !axis->model.modes.empty() || axis->model.direct != 1.0;
         });
}

// A piezoelectric sensor drifts; its mean without cutting is its zero.
void ForceCompensation::updateZero(const ForceBlock& measured) {
  if (!condition_ || condition_->isInWork() || measured.force[0].empty()) return;
  const double length = static_cast<double>(measured.force[0].size());
  const double weight = std::min(1.0, length / measured.sample_rate / parameters_.zero_time);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double mean = 0.0;
    for (const double force : measured.force[axis]) mean += std::isfinite(force) ? force / length : 0.0;
    health_.zero[axis] += weight * (mean - health_.zero[axis]);
  }
}

void ForceCompensation::check(const SampleBlock& block) {
  forceColumns(block);
}

ForceBlock ForceCompensation::measuredForce(const SampleBlock& block) {
  const std::array<std::size_t, 3> column = forceColumns(block);
  ForceBlock measured;
  measured.stamp = block.stamp;
  measured.sample_rate = block.sample_rate;
  measured.first_index = block.first_index;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double>& force = measured.force[axis];
    force.reserve(block.size());
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double sample = block.at(i, column[axis]);
      if (!std::isfinite(sample)) ++health_.not_finite;
      if (parameters_.saturation > 0.0 && std::abs(sample) >= parameters_.saturation) ++health_.clipped;
      force.push_back(sign_ * sample);
    }
  }
  return measured;
}

void ForceCompensation::handle(const SampleBlock& block) {
  const ForceBlock measured = measuredForce(block);
  if (next_index_ && *next_index_ != block.first_index) {
    ++health_.gaps;
    method_->stop();
  }
  next_index_ = block.first_index + block.size();
  updateZero(measured);
  ForceBlock compensated = measured;
  health_.speed_std = 0.0;
  if (!takeSpeed(block.stamp) || !hasDynamics() || !isMeasured(measured)) {
    method_->stop();
    health_.speed = 0.0;
    compensated.status = ForceBlock::Status::passed_through;
    outputs_.publish(measured, compensated);
    return;
  }
  if (method_->prepare(spindle_, block.sample_rate)) {
    settling_left_ = parameters_.settling_periods * parameters_.filter.settling_revolutions * units::TWO_PI /
                     spindle_.speed;
  }
  compensated.status = settling_left_ > 0.0 ? ForceBlock::Status::settling : ForceBlock::Status::compensated;
  settling_left_ -= static_cast<double>(block.size()) / block.sample_rate;
  method_->process(measured, std::move(compensated), health_);
  spindle_.speed = method_->speed();
  if (estimates_speed_) ++health_.estimated_blocks;
}

}  // namespace smartmill::kalman
