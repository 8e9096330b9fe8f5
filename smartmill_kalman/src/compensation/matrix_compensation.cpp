#include "smartmill_kalman/compensation/matrix_compensation.h"

#include <cmath>
#include <string>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_kalman/sensor/block_channels.h"

namespace smartmill::kalman {

MatrixCompensation::MatrixCompensation(const MatrixInverse& inverse, bool measures_workpiece,
                                       ForceOutputs outputs)
    : inverse_(inverse), sign_(measures_workpiece ? -1.0 : 1.0), outputs_(std::move(outputs)) {
  reset();
}

void MatrixCompensation::reset() {
  inverse_.reset();
  pending_.clear();
  for (auto& axis : ready_) axis.clear();
  discard_ = settling_samples_ = inverse_.latency();
  last_.assign(inverse_.channels(), 0.0);
  next_index_.reset();
}

std::vector<std::size_t> MatrixCompensation::columnsOf(const SampleBlock& block) const {
  if (std::abs(block.sample_rate / inverse_.sampleRate() - 1.0) > 1e-9) {
    throw Error(formatted("sample block: sample rate %.1f Hz, expected %.1f Hz as in plate_taps",
                          block.sample_rate, inverse_.sampleRate()));
  }
  std::vector<std::size_t> columns;
  for (std::size_t c = 0; c < inverse_.channels(); ++c)
    columns.push_back(columnOf(block, PLATE_CHANNELS[c], c < 3 ? "N" : "N m"));
  return columns;
}

void MatrixCompensation::handle(const SampleBlock& block) {
  const std::vector<std::size_t> columns = columnsOf(block);
  if (next_index_ && *next_index_ != block.first_index) {
    ++gaps_;
    flush();
    reset();
  }
  next_index_ = block.first_index + block.size();
  ForceBlock measured;
  measured.stamp = block.stamp;
  measured.sample_rate = block.sample_rate;
  measured.first_index = block.first_index;
  std::vector<std::vector<double>> samples(columns.size());
  for (std::size_t c = 0; c < columns.size(); ++c) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double sample = block.at(i, columns[c]);
      if (c < 3) measured.force[c].push_back(sign_ * sample);
      // The inverse gets the last valid sample; the output is NaN.
      if (std::isfinite(sample)) {
        last_[c] = sample;
      } else {
        ++not_finite_;
      }
      samples[c].push_back(sign_ * last_[c]);
    }
  }
  pending_.push_back(std::move(measured));
  const auto force = inverse_.process(samples);
  for (std::size_t i = 0; i < force[0].size(); ++i) {
    if (discard_ > 0) {
      --discard_;
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) ready_[axis].push_back(force[axis][i]);
  }
  while (!pending_.empty() && ready_[0].size() >= pending_.front().force[0].size()) publishOldest();
}

void MatrixCompensation::publishOldest() {
  const ForceBlock measured = std::move(pending_.front());
  pending_.pop_front();
  ForceBlock compensated = measured;
  const std::size_t count = measured.force[0].size();
  compensated.status = settling_samples_ > 0 ? ForceBlock::Status::settling : ForceBlock::Status::compensated;
  settling_samples_ -= std::min(settling_samples_, count);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < count; ++i) {
      const bool valid = std::isfinite(measured.force[0][i] + measured.force[1][i] + measured.force[2][i]);
      compensated.force[axis][i] = valid ? ready_[axis].front() : NOT_A_NUMBER;
      ready_[axis].pop_front();
    }
  }
  outputs_.publish(measured, compensated);
}

void MatrixCompensation::flush() {
  if (pending_.empty()) return;
  const auto force = inverse_.process(
      std::vector<std::vector<double>>(inverse_.channels(), std::vector<double>(inverse_.latency(), 0.0)));
  for (std::size_t axis = 0; axis < 3; ++axis)
    ready_[axis].insert(ready_[axis].end(), force[axis].begin() + static_cast<std::ptrdiff_t>(discard_),
                        force[axis].end());
  discard_ = 0;
  while (!pending_.empty() && ready_[0].size() >= pending_.front().force[0].size()) publishOldest();
  reset();
}

}  // namespace smartmill::kalman
