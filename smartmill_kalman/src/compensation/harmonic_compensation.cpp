#include "smartmill_kalman/compensation/harmonic_compensation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_kalman/compensation/innovation_statistics.h"

namespace smartmill::kalman {
HarmonicCompensation::HarmonicCompensation(const CompensationParameters& parameters, ForceOutputs outputs)
    : parameters_(parameters), outputs_(std::move(outputs)), schedule_(parameters.filter) {
}

void HarmonicCompensation::setSensor(std::size_t axis, const SensorAxis& sensor) {
  stop();
  sensor_.at(axis) = configured_sensor_.at(axis) = sensor;
  schedule_.clear();
}

void HarmonicCompensation::setMemory(const MemorySchedule& memory) {
  stop();
  schedule_.setMemory(memory);
}

void HarmonicCompensation::beginCondition(const CuttingCondition& condition) {
  stop();
  condition_ = condition;
  speed_tracker_.reset();
  restoreModes();
}

void HarmonicCompensation::restoreModes() {
  if (modes_shifted_) {
    sensor_ = configured_sensor_;
    schedule_.clear();
  }
  modes_shifted_ = false;
}

void HarmonicCompensation::stop() {
  flush();
  filters_.clear();
}

void HarmonicCompensation::reset() {
  filters_.clear();
  speed_tracker_.reset();
  condition_.reset();
  restoreModes();
}

bool HarmonicCompensation::prepare(const SpindleAngle& spindle, double sample_rate) {
  const bool at_rest = filters_.empty();
  spindle_ = spindle;
  if (at_rest || sample_rate_ != sample_rate || !schedule_.covers(grid_point_, spindle.speed)) {
    sample_rate_ = sample_rate;
    design();
  } else if (std::abs(spindle.speed / filters_.front().pairs().spindleSpeed() - 1.0) >
             parameters_.retune_tolerance) {
    retune();
  }
  if (parameters_.track_speed.isAlways() && !speed_tracker_)
    speed_tracker_.emplace(parameters_.tracker, parameters_.filter, spindle.speed, sample_rate);
  return at_rest;
}

// New filters take over the force of those before them.
void HarmonicCompensation::design() {
  grid_point_ = schedule_.gridPointOf(spindle_.speed);
  std::vector<HarmonicFilter> before;
  before.swap(filters_);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    filters_.emplace_back(schedule_.gains(axis, sensor_[axis], grid_point_, sample_rate_),
                          sensor_[axis].model, spindle_.speed, sample_rate_);
    filters_[axis].setWeighting(parameters_.filter.weighted);
    if (!before.empty()) filters_[axis].continueFrom(before[axis]);
  }
  onFiltersChanged(filters_, sample_rate_);
  mode_follower_.reset();
  if (parameters_.follow && condition_ && condition_->kind == CuttingCondition::Kind::cut) {
    const int harmonics = std::min(filters_[0].pairs().harmonics(), filters_[1].pairs().harmonics());
    if (harmonics > 0) {
      mode_follower_.emplace(*condition_, harmonics, parameters_.follower, parameters_.follow_revolutions,
                             parameters_.filter.memory_revolutions);
    }
  }
}

void HarmonicCompensation::retune() {
  for (std::size_t axis = 0; axis < 3; ++axis) filters_[axis].retune(sensor_[axis].model, spindle_.speed);
  onFiltersChanged(filters_, sample_rate_);
}

double HarmonicCompensation::step(std::size_t, HarmonicFilter& filter, double measured) {
  return std::isfinite(measured) ? filter.step(measured) : filter.predict();
}

void HarmonicCompensation::filterAxes(ForceBlock& block, InnovationStatistics& innovations) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (double& sample : block.force[axis]) {
      sample = step(axis, filters_[axis], sample);
      innovations.add(axis, filters_[axis]);
    }
  }
}

void HarmonicCompensation::filterSamples(ForceBlock& block, InnovationStatistics& innovations) {
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    std::array<double, 3> force{{block.force[0][i], block.force[1][i], block.force[2][i]}};
    if (speed_tracker_) speed_tracker_->prepare(filters_, spindle_.speed);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      force[axis] = step(axis, filters_[axis], force[axis]);
      innovations.add(axis, filters_[axis]);
    }
    couple(filters_, force);
    for (std::size_t axis = 0; axis < 3; ++axis) block.force[axis][i] = force[axis];
    if (!speed_tracker_) continue;
    speed_tracker_->update(filters_, {sensor_[0].noise_rms, sensor_[1].noise_rms, sensor_[2].noise_rms});
    if ((i + 1) % parameters_.retune_interval == 0 &&
        std::abs(speed_tracker_->speed() / spindle_.speed - 1.0) > parameters_.retune_tolerance) {
      spindle_.speed = speed_tracker_->speed();
      retune();
    }
  }
}

void HarmonicCompensation::process(const ForceBlock& measured, ForceBlock compensated,
                                   CompensationHealth& health) {
  InnovationStatistics innovations;
  health.speed = filters_.front().pairs().spindleSpeed();
  const std::size_t count = compensated.force[0].size();
  if (speed_tracker_ || isCoupled()) {
    filterSamples(compensated, innovations);
  } else {
    filterAxes(compensated, innovations);
  }
  innovations.report(count, health);
  if (speed_tracker_) {
    health.speed = spindle_.speed;
    health.speed_std = speed_tracker_->speedStd();
    if (health.speed_std > parameters_.speed_converged * health.speed)
      compensated.status = ForceBlock::Status::settling;
  }
  if (compensated.status == ForceBlock::Status::compensated &&
      health.innovation_ratio > parameters_.innovation_limit)
    compensated.status = ForceBlock::Status::transient;
  const double end = measured.stamp + static_cast<double>(count) / measured.sample_rate;
  publish(measured, std::move(compensated));
  if (mode_follower_ && followModes(end)) ++health.mode_updates;
}

void HarmonicCompensation::publish(const ForceBlock& measured, ForceBlock&& compensated) {
  outputs_.publish(measured, compensated);
}

bool HarmonicCompensation::followModes(double now) {
  const auto update =
      mode_follower_->update(now, spindle_, filters_, {sensor_[0].model, sensor_[1].model},
                             std::max(sensor_[0].noise_rms, sensor_[1].noise_rms), sample_rate_);
  if (!update) return false;
  modes_shifted_ = true;
  // Pending blocks belong to the modes that they were measured with.
  if (update->sensor[0].modes.size() != sensor_[0].model.modes.size()) flush();
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const bool redesign = !schedule_.suits(axis, update->sensor[axis]);
    sensor_[axis].model = update->sensor[axis];
    std::vector<HarmonicGain> gains;
    if (redesign) {
      schedule_.clear(axis);
      gains = schedule_.gains(axis, sensor_[axis], grid_point_, sample_rate_);
    }
    filters_[axis].replaceSensor(sensor_[axis].model, std::move(gains));
  }
  onFiltersChanged(filters_, sample_rate_);
  return true;
}

}  // namespace smartmill::kalman
