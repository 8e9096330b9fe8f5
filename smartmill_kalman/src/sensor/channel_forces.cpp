#include "smartmill_kalman/sensor/channel_forces.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_kalman/sensor/block_channels.h"

namespace smartmill::kalman {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Columns d, r x d: force and moment of a unit force at each channel.
MatrixXd equilibrium(const SensorChannels& sensor) {
  MatrixXd b(static_cast<Index>(sensor.components), static_cast<Index>(sensor.channels.size()));
  for (Index c = 0; c < b.cols(); ++c) {
    const SensorChannel& channel = sensor.channels[static_cast<std::size_t>(c)];
    const auto& d = channel.direction;
    const auto& r = channel.position;
    const double wrench[6] = {
        d[0], d[1], d[2], r[1] * d[2] - r[2] * d[1], r[2] * d[0] - r[0] * d[2], r[0] * d[1] - r[1] * d[0]};
    for (Index i = 0; i < b.rows(); ++i) b(i, c) = wrench[i];
  }
  return b;
}

/// Of a matrix with one row for each component; moments in units of the length that gives their rows the size
/// of those of the forces.
double conditionOf(MatrixXd rows) {
  if (rows.rows() > 3) rows.bottomRows(3) *= rows.topRows(3).norm() / rows.bottomRows(3).norm();
  if (!rows.allFinite()) return std::numeric_limits<double>::infinity();
  const Eigen::VectorXd values = linear::singularValues(rows);
  const double least = values[values.size() - 1];
  return least > 0.0 ? values[0] / least : std::numeric_limits<double>::infinity();
}

}  // namespace

ChannelForces::ChannelForces(const SensorChannels& sensor) : sensor_(sensor) {
  const std::string where = "force_sensor.channels: ";
  if (sensor.components != 3 && sensor.components != 6)
    throw Error(where + formatted("%zu components, expected 3 or 6", sensor.components));
  if (sensor.channels.size() < sensor.components) {
    throw Error(where + formatted("%zu channels, expected at least %zu for as many components",
                                  sensor.channels.size(), sensor.components));
  }
  const bool measured = !sensor.channels.front().response.empty();
  MatrixXd rows;  // one for each component
  if (measured) {
    rows.resize(static_cast<Index>(sensor.components), static_cast<Index>(sensor.channels.size()));
    for (Index c = 0; c < rows.cols(); ++c) {
      const SensorChannel& channel = sensor.channels[static_cast<std::size_t>(c)];
      if (channel.response.size() != sensor.components) {
        throw Error(where + formatted("channel %s: response of %zu numbers, expected %zu",
                                      channel.name.c_str(), channel.response.size(), sensor.components));
      }
      for (Index i = 0; i < rows.rows(); ++i) rows(i, c) = channel.response[static_cast<std::size_t>(i)];
    }
  } else {
    rows = equilibrium(sensor);
  }
  condition_ = conditionOf(rows);
  if (!(condition_ <= MOST_CONDITION)) {
    throw Error(where +
                formatted("condition number %.3g of %zu components from %zu channels, expected at most %.0f",
                          condition_, sensor.components, sensor.channels.size(), MOST_CONDITION));
  }
  if (measured) {
    estimate_ = linear::solveSymmetric(MatrixXd(rows * rows.transpose()), rows);
  } else {
    estimate_ = rows;
    for (Index c = 0; c < rows.cols(); ++c)
      estimate_.col(c) *= sensor.channels[static_cast<std::size_t>(c)].force_per_unit;
  }
  if (!sensor.noise_rms) return;
  for (Index i = 0; i < estimate_.rows(); ++i)
    deviations_.push_back(*sensor.noise_rms * estimate_.row(i).norm());
}

bool ChannelForces::isOf(const SampleBlock& block) const {
  return std::find(block.channels.begin(), block.channels.end(), sensor_.channels.front().name) !=
         block.channels.end();
}

SampleBlock ChannelForces::forces(const SampleBlock& block) const {
  std::vector<std::size_t> columns;
  for (const SensorChannel& channel : sensor_.channels)
    columns.push_back(columnOf(block, channel.name, sensor_.unit));
  SampleBlock out;
  out.stamp = block.stamp;
  out.sample_rate = block.sample_rate;
  out.first_index = block.first_index;
  for (std::size_t c = 0; c < sensor_.components; ++c) {
    out.channels.emplace_back(PLATE_CHANNELS[c]);
    out.units.emplace_back(c < 3 ? "N" : "N m");
  }
  out.samples.reserve(block.size() * sensor_.components);
  Eigen::VectorXd reading(static_cast<Index>(columns.size()));
  for (std::size_t i = 0; i < block.size(); ++i) {
    for (std::size_t c = 0; c < columns.size(); ++c) reading[static_cast<Index>(c)] = block.at(i, columns[c]);
    const bool valid = reading.allFinite();
    const Eigen::VectorXd wrench = estimate_ * reading;
    for (Index c = 0; c < wrench.size(); ++c) out.samples.push_back(valid ? wrench[c] : NOT_A_NUMBER);
  }
  return out;
}

}  // namespace smartmill::kalman
