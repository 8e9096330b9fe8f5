#include "smartmill_loadmeter/motor/force_record.h"

#include <cmath>
#include <vector>

namespace smartmill::loadmeter {

namespace {

constexpr std::size_t MIN_BLOCKS = 8;  // blocks

}  // namespace

Estimate ForceMeasurement::meanAbove(const std::optional<ForceMeasurement>& air, std::size_t axis) const {
  if (!air) return mean[axis];
  return {mean[axis].value - air->mean[axis].value, std::hypot(mean[axis].std_dev, air->mean[axis].std_dev)};
}

std::optional<Estimate> ForceMeasurement::rmsAbove(const std::optional<ForceMeasurement>& air,
                                                   std::size_t axis) const {
  const double beyond = variance[axis] - (air ? air->variance[axis] : 0.0);
  const double std_dev = std::hypot(variance_std[axis], air ? air->variance_std[axis] : 0.0);
  if (!(beyond > 2.0 * std_dev) || !(beyond > 0.0)) return std::nullopt;
  const double rms = std::sqrt(beyond);
  return Estimate{rms, 0.5 * std_dev / rms};
}

void ForceRecord::add(const ForceBlock& block) {
  if (block.isUnusable() || block.force[0].empty()) return;
  BlockSums block_sums;
  block_sums.count = static_cast<double>(block.force[0].size());
  block_sums.end = block.stamp + block_sums.count / block.sample_rate;
  for (std::size_t a = 0; a < 3; ++a) {
    for (const double f : block.force[a]) {
      if (!std::isfinite(f)) return;
      block_sums.mean[a] += f / block_sums.count;
      block_sums.square[a] += f * f / block_sums.count;
    }
  }
  blocks_.push_back(block_sums);
}

void ForceRecord::dropAfter(double stamp) {
  while (!blocks_.empty() && blocks_.back().end > stamp) blocks_.pop_back();
}

std::optional<ForceMeasurement> ForceRecord::measurement(double since) const {
  std::vector<BlockSums> blocks;
  for (const BlockSums& block_sums : blocks_) {
    if (block_sums.end > since) blocks.push_back(block_sums);
  }
  if (blocks.size() < MIN_BLOCKS) return std::nullopt;
  const double n = static_cast<double>(blocks.size());
  ForceMeasurement measurement;
  for (std::size_t a = 0; a < 3; ++a) {
    double mean = 0.0, square = 0.0, mean2 = 0.0, square2 = 0.0;
    for (const BlockSums& block_sums : blocks) {
      mean += block_sums.mean[a] / n;
      square += block_sums.square[a] / n;
    }
    for (const BlockSums& block_sums : blocks) {
      mean2 += std::pow(block_sums.mean[a] - mean, 2);
      square2 += std::pow(block_sums.square[a] - square, 2);
    }
    measurement.mean[a] = {mean, std::sqrt(mean2 / (n * (n - 1.0)))};
    measurement.variance[a] = std::max(0.0, square - mean * mean);
    measurement.variance_std[a] = std::sqrt(square2 / (n * (n - 1.0)));
  }
  return measurement;
}

}  // namespace smartmill::loadmeter
