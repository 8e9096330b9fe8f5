#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// Acceleration of the machine axes in a record: smoothed derivative of their velocity (columns axis_vx..)
/// or, without it, of their position (axis_x..).
class AxisMotion {
 public:
  static bool isRecorded(const Record& record);

  /// @param smoothing [s] of smoothedDerivative()
  AxisMotion(const Record& record, double sample_rate, double smoothing);

  /// [m/s2] of x, y, z, interpolated linearly between sample i (share 0) and the next one (share 1); 0 for
  /// axes without columns.
  Axes3 acceleration(std::size_t i, double share) const;
  /// [m/s2] at each sample of an axis, 0 to 2; empty: without columns.
  const std::vector<double>& samples(std::size_t axis) const { return acceleration_[axis]; }

 private:
  std::array<std::vector<double>, 3> acceleration_;  // [m/s2] at each sample; empty: not recorded
};

}  // namespace smartmill::sim
