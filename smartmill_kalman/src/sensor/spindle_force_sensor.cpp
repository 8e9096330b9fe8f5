#include "smartmill_kalman/sensor/spindle_force_sensor.h"

#include <algorithm>
#include <cmath>

#include "smartmill_kalman/sensor/block_channels.h"

namespace smartmill::kalman {

using Complex = std::complex<double>;

SpindleForceSensor::SpindleForceSensor(const SpindleSensorCalibration& calibration, double length)
    : calibration_(calibration),
      cross_talk_(SpindleConstants(calibration, length)),
      air_cuts_(calibration, SpindleConstants(calibration, length)) {
  reset();
}

std::array<std::size_t, 6> SpindleForceSensor::columnsOf(const SampleBlock& block) {
  std::array<std::size_t, 6> column{};
  for (std::size_t k = 0; k < 6; ++k) column[k] = columnOf(block, SPINDLE_SENSOR_CHANNELS[k], "N");
  return column;
}

bool SpindleForceSensor::isSixChannels(const SampleBlock& block) {
  return std::find(block.channels.begin(), block.channels.end(), SPINDLE_SENSOR_CHANNELS[0]) !=
         block.channels.end();
}

void SpindleForceSensor::reset() {
  air_cuts_.reset();
  cross_talk_.reset();
  low_pass_.clear();
  next_index_.reset();
  any_invalid_ = false;
  health_ = {};
  copyAirCuts();
}

void SpindleForceSensor::keepUnbalance(const SpindleForceSensor& before) {
  air_cuts_.keepUnbalance(before.air_cuts_);
  copyAirCuts();
}

void SpindleForceSensor::copyAirCuts() {
  health_.air_segments = air_cuts_.segments();
  health_.unbalance = air_cuts_.unbalance();
  health_.unbalance_std = air_cuts_.unbalanceStd();
}

void SpindleForceSensor::handle(const CuttingCondition& condition) {
  air_cuts_.handle(condition);
  copyAirCuts();
}

bool SpindleForceSensor::subtractZero(double time, std::array<double, 6>& sensors) {
  const auto& zero = air_cuts_.zero();
  bool unloaded = false, overloaded = false;
  for (std::size_t k = 0; k < 6; ++k) {
    if (zero) sensors[k] -= zero->offset[k] + zero->drift[k] * (time - zero->at);
    const double compression = calibration_.preload[k] + sensors[k];
    const double left = compression - calibration_.least_compression;
    health_.compression_margin = std::min(health_.compression_margin, left);
    unloaded = unloaded || left <= 0.0;
    overloaded = overloaded || compression > calibration_.range_limit;
  }
  if (unloaded) ++health_.unloaded;
  if (overloaded) ++health_.overloaded;
  return !unloaded && !overloaded;
}

SampleBlock SpindleForceSensor::handle(const SampleBlock& block) {
  const std::array<std::size_t, 6> column = columnsOf(block);
  air_cuts_.beginBlock(block);
  copyAirCuts();
  cross_talk_.prepare(block.sample_rate, next_index_ && *next_index_ != block.first_index);
  next_index_ = block.first_index + block.size();
  SampleBlock forces;
  forces.stamp = block.stamp;
  forces.sample_rate = block.sample_rate;
  forces.first_index = block.first_index;
  forces.channels.assign(FORCE_CHANNELS.begin(), FORCE_CHANNELS.end());
  forces.units = {"N", "N", "N"};
  forces.samples.reserve(3 * block.size());
  invalid_.assign(block.size(), false);
  any_invalid_ = false;
  // Unbalance at the first sample and its rotation to the next.
  std::array<Complex, 3> unbalance = air_cuts_.unbalanceForce(block.stamp);
  const Complex turn = air_cuts_.turn(block.sample_rate);
  for (std::size_t i = 0; i < block.size(); ++i) {
    std::array<double, 6> sensors{};
    bool finite = true;
    for (std::size_t k = 0; k < 6; ++k) {
      sensors[k] = block.at(i, column[k]);
      finite = finite && std::isfinite(sensors[k]);
    }
    air_cuts_.add(sensors);
    invalid_[i] = finite && !subtractZero(block.timeOf(i), sensors);
    any_invalid_ = any_invalid_ || invalid_[i];
    if (finite && !invalid_[i]) {
      const std::array<double, 3> force = cross_talk_.step(sensors);
      for (std::size_t axis = 0; axis < 3; ++axis)
        forces.samples.push_back(force[axis] - unbalance[axis].real());
    } else {
      cross_talk_.skip();
      forces.samples.insert(forces.samples.end(), 3, NOT_A_NUMBER);
    }
    for (Complex& p : unbalance) p *= turn;
  }
  if (const auto& zero = air_cuts_.zero()) {
    const double t = block.stamp - zero->at;
    health_.zero_std = std::sqrt(std::max(0.0, 0.5 * (zero->oo + 2.0 * zero->od * t + zero->dd * t * t)));
  }
  return forces;
}

void SpindleForceSensor::lowPass(ForceBlock& block) {
  if (calibration_.low_pass <= 0.0) return;
  if (low_pass_.empty() || low_pass_rate_ != block.sample_rate || next_low_pass_ != block.first_index) {
    low_pass_.assign(3, LowPass(calibration_.low_pass, block.sample_rate));
    low_pass_rate_ = block.sample_rate;
  }
  next_low_pass_ = block.first_index + block.force[0].size();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (double& force : block.force[axis]) force = low_pass_[axis].step(force);
  }
}

}  // namespace smartmill::kalman
