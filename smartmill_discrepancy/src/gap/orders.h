#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace smartmill::discrepancy {

/// Level and orders k = 1, 2, ... of an angle over samples: cos(k a), sin(k a), each order from the one
/// before it, some samples side by side.
class Orders {
 public:
  /// @param angle [rad] of each sample
  explicit Orders(const std::vector<double>& angle);

  /// Sums over the samples of the values, then of values cos(k a) and values sin(k a) for k = 1..count.
  /// @param values one a sample
  std::vector<double> along(const std::vector<double>& values, std::size_t count) const;
  /// What lines of these amplitudes (level, then cosine and sine of each order) add up to at each sample.
  std::vector<double> sumOf(const std::vector<double>& lines) const;

 private:
  static constexpr Eigen::Index SIDE_BY_SIDE = 8;
  using Lanes = Eigen::Array<double, SIDE_BY_SIDE, 1>;

  std::size_t samples_;
  std::vector<Lanes> cosine_, sine_;  // of the angle; beyond the last sample an angle of 0
};

}  // namespace smartmill::discrepancy
