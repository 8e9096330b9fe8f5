#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace smartmill::discrepancy {

/// Mean and orders k = 1, 2, ... of an angle over samples: cos(k a), sin(k a) by recursion, several samples
/// at once.
class OrderBasis {
 public:
  /// @param angle [rad] of each sample
  explicit OrderBasis(const std::vector<double>& angle);

  /// Sums over the samples of the values, then of values cos(k a) and values sin(k a) for k = 1..count.
  /// @param values one per sample
  std::vector<double> along(const std::vector<double>& values, std::size_t count) const;
  /// Sum of lines with these amplitudes (mean, then cosine and sine of each order) at each sample.
  std::vector<double> sumOf(const std::vector<double>& lines) const;

 private:
  static constexpr Eigen::Index LANES = 8;
  using Lanes = Eigen::Array<double, LANES, 1>;

  std::size_t samples_;
  std::vector<Lanes> cosine_, sine_;  // of the angle; 0 beyond the last sample
};

}  // namespace smartmill::discrepancy
