#include "smartmill_discrepancy/gap/whitening.h"

#include <algorithm>
#include <cmath>

namespace smartmill::discrepancy {
namespace {

struct WhiteningOptions {
  std::size_t max_order = 32;          ///< limits the time; the BIC chooses the order
  std::size_t samples_per_order = 16;  ///< minimum, so that a few values get at most a variance
};

const WhiteningOptions LIMITS;

// For lags up to the order, with the biased normalisation that keeps every predictor stable.
std::vector<double> autocovariance(const double* values, std::size_t size, std::size_t order) {
  std::vector<double> lags(order + 1, 0.0);
  for (std::size_t lag = 0; lag <= order; ++lag) {
    for (std::size_t i = lag; i < size; ++i) lags[lag] += values[i] * values[i - lag];
    lags[lag] /= static_cast<double>(size);
  }
  return lags;
}

// Levinson-Durbin step to the next order. @param variance of the prediction error, updated
std::vector<double> nextPredictor(const std::vector<double>& weights, const std::vector<double>& lags,
                                  double* variance) {
  const std::size_t m = weights.size() + 1;
  double reflection = lags[m];
  for (std::size_t k = 0; k + 1 < m; ++k) reflection -= weights[k] * lags[m - 1 - k];
  reflection /= *variance;
  std::vector<double> next = weights;
  for (std::size_t k = 0; k + 1 < m; ++k) next[k] -= reflection * weights[m - 2 - k];
  next.push_back(reflection);
  *variance *= 1.0 - reflection * reflection;
  return next;
}

}  // namespace

Whitening::Whitening(const double* residual, std::size_t size) {
  const std::size_t max_order = std::min(LIMITS.max_order, size / LIMITS.samples_per_order);
  const std::vector<double> lags = autocovariance(residual, size, max_order);
  const auto n = static_cast<double>(size);
  if (size == 0 || !std::isfinite(lags[0]) || lags[0] <= 0.0) return;
  std::vector<Predictor> predictors;
  Predictor predictor;
  double variance = lags[0], best = n * variance;  // -2 ln likelihood of white noise as stated
  for (std::size_t order = 0; order <= max_order; ++order) {
    if (order > 0) predictor.weights = nextPredictor(predictor.weights, lags, &variance);
    if (!(variance > 0.0)) break;
    predictor.rms = std::sqrt(std::max(variance, 1.0));
    predictors.push_back(predictor);
    const double level = predictor.rms * predictor.rms;
    const double bic =
        n * std::log(level) + n * variance / level + static_cast<double>(order + 1) * std::log(n);
    if (bic >= best) continue;
    best = bic;
    predictors_ = predictors;
  }
}

void Whitening::apply(double* values, std::size_t size) const {
  if (!isActive()) return;
  // Backwards, since earlier samples must be unfiltered.
  for (std::size_t i = size; i-- > 0;) {
    const Predictor& predictor = predictors_[std::min(i, order())];
    double predicted = 0.0;
    for (std::size_t k = 0; k < predictor.weights.size(); ++k)
      predicted += predictor.weights[k] * values[i - 1 - k];
    values[i] = (values[i] - predicted) / predictor.rms;
  }
}

}  // namespace smartmill::discrepancy
