#include "smartmill_discrepancy/gap/whitening.h"

#include <algorithm>
#include <cmath>

namespace smartmill::discrepancy {
namespace {

// Of lags up to the order; shrunk by the samples that are missing at the ends, which keeps every predictor
// stable.
std::vector<double> autocovariance(const double* values, std::size_t size, std::size_t order) {
  std::vector<double> lags(order + 1, 0.0);
  for (std::size_t lag = 0; lag <= order; ++lag) {
    for (std::size_t i = lag; i < size; ++i) lags[lag] += values[i] * values[i - lag];
    lags[lag] /= static_cast<double>(size);
  }
  return lags;
}

// Predictor of one order more. @param variance of what is not told, made that of the new one
std::vector<double> longer(const std::vector<double>& weights, const std::vector<double>& lags,
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

Whitening::Whitening(const double* left, std::size_t size) {
  constexpr std::size_t SAMPLES_OF_ORDER = 16;  // at least, so that a few values are given a level at most
  const std::size_t most = std::min(MOST, size / SAMPLES_OF_ORDER);
  const std::vector<double> lags = autocovariance(left, size, most);
  const auto n = static_cast<double>(size);
  if (size == 0 || !std::isfinite(lags[0]) || lags[0] <= 0.0) return;
  std::vector<Step> steps;
  Step step;
  double variance = lags[0], best = n * variance;  // -2 ln likelihood of white noise as stated
  for (std::size_t order = 0; order <= most; ++order) {
    if (order > 0) step.weights = longer(step.weights, lags, &variance);
    if (!(variance > 0.0)) break;
    step.rms = std::sqrt(std::max(variance, 1.0));
    steps.push_back(step);
    const double level = step.rms * step.rms;
    const double bic =
        n * std::log(level) + n * variance / level + static_cast<double>(order + 1) * std::log(n);
    if (bic >= best) continue;
    best = bic;
    steps_ = steps;
  }
}

void Whitening::apply(double* values, std::size_t size) const {
  if (!changes()) return;
  // From the end on, so that the samples before are still what they were.
  for (std::size_t i = size; i-- > 0;) {
    const Step& step = steps_[std::min(i, order())];
    double told = 0.0;
    for (std::size_t k = 0; k < step.weights.size(); ++k) told += step.weights[k] * values[i - 1 - k];
    values[i] = (values[i] - told) / step.rms;
  }
}

}  // namespace smartmill::discrepancy
