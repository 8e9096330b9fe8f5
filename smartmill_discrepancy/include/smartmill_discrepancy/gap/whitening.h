#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::discrepancy {

/// Autoregression of a channel's residual: x_i = a_1 x_{i-1} + .. + a_p x_{i-p} + e_i. The prediction errors
/// over their RMS are white. The filter is the inverse root of the residual's covariance, the weight of
/// generalised least squares (Aitken 1935): applied to residuals and derivatives it gives ordinary least
/// squares.
/// Coefficients by the Levinson-Durbin recursion (Durbin 1960, The fitting of time-series models) from the
/// autocovariance; the first p samples use the shorter predictors of the same recursion, so that the filter
/// is exact from the first sample on. Among white noise as stated and the orders up to a maximum the least
/// BIC of the Gaussian likelihood is chosen; the variance of e is at least that of the noise.
class Whitening {
 public:
  /// Identity.
  Whitening() = default;
  /// @param residual of a channel, over its noise
  Whitening(const double* residual, std::size_t size);

  bool isActive() const { return !predictors_.empty(); }
  std::size_t order() const { return predictors_.empty() ? 0 : predictors_.size() - 1; }
  /// [1] RMS of the prediction errors over the noise.
  double innovation() const { return predictors_.empty() ? 1.0 : predictors_.back().rms; }

  /// Filters a channel in place, from its first sample on.
  void apply(double* values, std::size_t size) const;

 private:
  // Predictor from the previous samples, the latest first.
  struct Predictor {
    std::vector<double> weights;
    double rms = 1.0;
  };
  std::vector<Predictor> predictors_;  // of orders 0 .. p; empty: white noise as stated
};

}  // namespace smartmill::discrepancy
