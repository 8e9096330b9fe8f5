#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/model/sensor_channels.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::kalman {

/// Forces, or forces and moments, from any number of channels of a force sensor (Bachrathy and Stepan section
/// 2.2: eight channels of a piezoelectric dynamometer), by least squares.
///
/// With directions d and positions r: a rigid plate on equally stiff elements, whose shares of the load are
/// B' (B B')^-1 times force and moment, B with the columns d, r x d. The least squares solution is B times
/// the channels' forces, which is the equilibrium of the plate whatever the stiffnesses, as long as the
/// channels measure all force along their directions. With a measured response (one row for each channel):
/// its pseudo-inverse.
class ChannelForces {
 public:
  /// Above it the channels do not determine the components: sensitivities are right to about 1 %, which the
  /// weakest combination of components shows enlarged by the condition number.
  static constexpr double MOST_CONDITION = 30.0;

  /// @throws Error of one line when the channels do not determine the components.
  explicit ChannelForces(const SensorChannels& sensor);

  /// Whether a block has the first of the channels; a block with forces does not.
  bool isOf(const SampleBlock& block) const;
  /// Block of fx, fy, fz [N] or also mx, my, mz [N m], about the origin of the positions; NaN where a channel
  /// is not finite. @throws Error naming a channel that is missing or in another unit.
  SampleBlock forces(const SampleBlock& block) const;

  /// [1] Condition number of the components, moments over a length of the size of the sensor.
  double condition() const { return condition_; }
  /// [N], [N m] standard deviation of each component for the channels' noise; empty: the noise is not stated.
  const std::vector<double>& deviations() const { return deviations_; }
  std::size_t channels() const { return sensor_.channels.size(); }
  std::size_t components() const { return sensor_.components; }

 private:
  SensorChannels sensor_;
  Eigen::MatrixXd estimate_;  // components x channels
  double condition_ = 0.0;
  std::vector<double> deviations_;
};

}  // namespace smartmill::kalman
