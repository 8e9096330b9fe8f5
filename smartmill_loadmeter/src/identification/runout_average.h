#pragma once

#include <cstddef>
#include <vector>

#include "load_record.h"
#include "load_regression.h"

namespace smartmill::loadmeter {

/// Coefficients averaged over a runout of unknown offset and angle.
struct RunoutAverage {
  double offset = 0.0;          ///< [m]
  bool is_significant = false;  ///< the records exclude a zero offset
  double ktc = 0.0, kte = 0.0;
  double variance_tc = 0.0, variance_te = 0.0, covariance = 0.0;  ///< between the offsets
};

struct RunoutAveragingOptions {
  /// @{ [1] relative standard deviation of the model's ripple variance: samples at many phases, at a few.
  double ripple_error = 0.1, sparse_ripple_error = 0.3;
  /// @}
  double few_phases = 3.0;  ///< [1] independent phases of the ripple that sparse samples show
  int offsets = 25;         ///< [1] evenly spaced, of a pass over a range of offsets
  int noises = 16;          ///< [1] sizes of a cut's own noise, evenly spaced up to twice the largest scatter
  double negligible = 12.0;  ///< [1] log of a weight's ratio to the largest below which an offset is left out
  double significant = 5.0;  ///< [1] log of the evidence against a zero offset that excludes it
};

/// Average of fits over offsets of the cutter axis, for records without the spindle angle. Where teeth leave
/// the cut for a part of their arc, runout only reduces the edge in cut, so that a zero offset is a biased
/// centre: each offset has its own fit, weighted by the likelihood of means and scatter of the records.
class RunoutAveraging {
 public:
  /// @param largest [m] offset. The effects are tabulated at the state's lag.
  RunoutAveraging(const LoadRegression& regression, const LoadState& state, double largest,
                  const RunoutAveragingOptions& options = {});

  RunoutAverage average(const LoadState& state) const;
  /// Adds the variance of aliased harmonics, which averaging readings does not reduce, to the cuts' means.
  void addAliasedVariance(const RunoutAverage& average, LoadState* state) const;
  /// Applies the mean torque at an offset to the cuts.
  void applyOffset(double offset, LoadState* state) const;

 private:
  struct Point;

  double scatterEvidence(const LoadState& state, const Point& point) const;
  std::vector<Point> evaluate(const LoadState& state, double low, double high) const;

  const LoadRegression& regression_;
  RunoutAveragingOptions options_;
  double largest_;
  std::vector<RunoutEffect> effects_;  // of the cuts, in order
  double air_variance_ = 0.0;          // [V2] scatter in air
  bool air_variance_known_ = false;
};

}  // namespace smartmill::loadmeter
