#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::discrepancy {

/// What follows upon another in what a model leaves of a channel, told by the samples before: an
/// autoregression x_i = a_1 x_{i-1} + .. + a_p x_{i-p} + e_i. What it cannot tell, over its RMS, is white, so
/// that each sample counts once. Its inverse covariance is the weight of generalised least squares (Aitken
/// 1935): the same filter over residuals and tangents makes ordinary least squares of it.
///
/// Coefficients by Levinson and Durbin (Durbin 1960, The fitting of time-series models) from the
/// autocovariance; the first p samples are told by the shorter predictors of the same recursion, so that the
/// filter is the exact inverse root of the covariance. Of white noise as stated and the orders up to
/// MOST the one of least BIC, by the Gaussian likelihood, is taken; e is never taken for less than the noise.
class Whitening {
 public:
  static constexpr std::size_t MOST = 32;

  /// Leaves everything as it is.
  Whitening() = default;
  /// @param left of a channel, over its noise
  Whitening(const double* left, std::size_t size);

  bool changes() const { return !steps_.empty(); }
  std::size_t order() const { return steps_.empty() ? 0 : steps_.size() - 1; }
  /// [1] RMS of what the samples before do not tell, over the noise.
  double innovation() const { return steps_.empty() ? 1.0 : steps_.back().rms; }

  /// Over a channel in place, from its first sample on.
  void apply(double* values, std::size_t size) const;

 private:
  // Predictor from so many samples as it has weights, the last sample first.
  struct Step {
    std::vector<double> weights;
    double rms = 1.0;
  };
  std::vector<Step> steps_;  // of orders 0 .. p; empty: white as stated
};

}  // namespace smartmill::discrepancy
