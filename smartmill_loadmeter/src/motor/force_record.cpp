#include "smartmill_loadmeter/motor/force_record.h"

#include <cmath>
#include <vector>

namespace smartmill::loadmeter {

namespace {

constexpr std::size_t FEWEST = 8;

}  // namespace

Estimate ForceReading::meanOver(const std::optional<ForceReading>& air, std::size_t axis) const {
  if (!air) return mean[axis];
  return {mean[axis].value - air->mean[axis].value, std::hypot(mean[axis].std_dev, air->mean[axis].std_dev)};
}

std::optional<Estimate> ForceReading::rmsOver(const std::optional<ForceReading>& air,
                                              std::size_t axis) const {
  const double beyond = variance[axis] - (air ? air->variance[axis] : 0.0);
  const double std_dev = std::hypot(variance_std[axis], air ? air->variance_std[axis] : 0.0);
  if (!(beyond > 2.0 * std_dev) || !(beyond > 0.0)) return std::nullopt;
  const double rms = std::sqrt(beyond);
  return Estimate{rms, 0.5 * std_dev / rms};
}

void ForceRecord::add(const ForceBlock& block) {
  if (block.status == ForceBlock::Status::settling || block.force[0].empty()) return;
  Part part;
  part.count = static_cast<double>(block.force[0].size());
  part.end = block.stamp + part.count / block.sample_rate;
  for (std::size_t a = 0; a < 3; ++a) {
    for (const double f : block.force[a]) {
      if (!std::isfinite(f)) return;
      part.mean[a] += f / part.count;
      part.square[a] += f * f / part.count;
    }
  }
  parts_.push_back(part);
}

void ForceRecord::dropAfter(double stamp) {
  while (!parts_.empty() && parts_.back().end > stamp) parts_.pop_back();
}

std::optional<ForceReading> ForceRecord::reading(double since) const {
  std::vector<Part> parts;
  for (const Part& part : parts_) {
    if (part.end > since) parts.push_back(part);
  }
  if (parts.size() < FEWEST) return std::nullopt;
  const double n = static_cast<double>(parts.size());
  ForceReading reading;
  for (std::size_t a = 0; a < 3; ++a) {
    double mean = 0.0, square = 0.0, mean2 = 0.0, square2 = 0.0;
    for (const Part& part : parts) {
      mean += part.mean[a] / n;
      square += part.square[a] / n;
    }
    for (const Part& part : parts) {
      mean2 += std::pow(part.mean[a] - mean, 2);
      square2 += std::pow(part.square[a] - square, 2);
    }
    reading.mean[a] = {mean, std::sqrt(mean2 / (n * (n - 1.0)))};
    reading.variance[a] = std::max(0.0, square - mean * mean);
    reading.variance_std[a] = std::sqrt(square2 / (n * (n - 1.0)));
  }
  return reading;
}

}  // namespace smartmill::loadmeter
