#include "free_decay.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<double> averaged(const std::vector<double>& values, std::size_t from, std::size_t group) {
  std::vector<double> result((values.size() - from) / group);
  for (std::size_t i = 0; i < result.size(); ++i) {
    for (std::size_t k = 0; k < group; ++k)
      result[i] += values[from + i * group + k] / static_cast<double>(group);
  }
  return result;
}

/// Coefficients of y[n] = sum a[k] y[n - 1 - k] over the selected rows.
VectorXd prediction(const std::vector<double>& y, std::size_t order, const std::vector<bool>& rows,
                    double noise) {
  const auto p = static_cast<Index>(order);
  const Index count =
      static_cast<Index>(std::count(rows.begin() + static_cast<std::ptrdiff_t>(order), rows.end(), true));
  MatrixXd past(count, p);
  VectorXd now(count);
  Index row = 0;
  for (std::size_t n = order; n < y.size(); ++n) {
    if (!rows[n]) continue;
    for (Index k = 0; k < p; ++k) past(row, k) = y[n - 1 - static_cast<std::size_t>(k)];
    now[row++] = y[n];
  }
  MatrixXd normal = past.transpose() * past;
  const VectorXd along = past.transpose() * now;
  normal.diagonal().array() += 1e-12 * normal.diagonal().maxCoeff() + noise * noise;
  return linear::solveSymmetric(normal, along);
}

std::vector<double> predictionResidual(const std::vector<double>& y, std::size_t order, const VectorXd& a) {
  std::vector<double> residual(y.size(), 0.0);
  for (std::size_t n = order; n < y.size(); ++n) {
    residual[n] = y[n];
    for (std::size_t k = 0; k < order; ++k) residual[n] -= a[static_cast<Index>(k)] * y[n - 1 - k];
  }
  return residual;
}

double robustDeviation(const std::vector<double>& residual, std::size_t order) {
  std::vector<double> sizes;
  for (std::size_t n = order; n < residual.size(); ++n) sizes.push_back(std::abs(residual[n]));
  return median(sizes) / 0.6745;
}

FreeDecayBreak breakAt(const std::vector<double>& y, std::size_t group, double largest, double noise,
                       const FreeDecayLimits& limits) {
  const std::size_t order = std::min(limits.order, y.size() / (limits.rows_a_coefficient + 1));
  if (order < 8) return {};
  std::vector<bool> rows(y.size(), true);
  std::vector<double> residual = predictionResidual(y, order, prediction(y, order, rows, noise));
  // Again without outliers, which bias the prediction.
  const double first = robustDeviation(residual, order);
  for (std::size_t n = order; n < y.size(); ++n) rows[n] = std::abs(residual[n]) < limits.outlier * first;
  residual = predictionResidual(y, order, prediction(y, order, rows, noise));
  const double noise_level = std::max(robustDeviation(residual, order), noise);
  FreeDecayBreak found;
  for (std::size_t n = order; group == 1 && n < residual.size(); ++n) {
    if (std::abs(residual[n]) >
        std::max({limits.outlier * noise_level, limits.outlier_share * largest, found.size}))
      found = {n, std::abs(residual[n]), true};
  }
  if (found.sample > 0) return found;
  double least_size = INFINITY;
  for (std::size_t n = order; n + limits.segment <= residual.size(); n += limits.segment / 2) {
    double sum = 0.0;
    for (std::size_t i = n; i < n + limits.segment; ++i) sum += residual[i] * residual[i];
    const double size = std::sqrt(sum / static_cast<double>(limits.segment));
    // A deviation by sensor nonlinearity decays with the ringing and does not recur.
    if (size >
        std::max({limits.deviation * std::max(noise_level, std::isfinite(least_size) ? least_size : size),
                  limits.deviation_share * largest, found.size}))
      found = {n, size, false};
    least_size = std::min(least_size, size);
  }
  return found;
}

}  // namespace

double unpredictedRise(const std::vector<double>& response, std::size_t from, std::size_t begin,
                       std::size_t end, double noise, const FreeDecayLimits& limits) {
  double most = 0.0;
  for (const std::size_t group : {1, 4, 16}) {
    const std::vector<double> y = averaged(response, from, group);
    const std::size_t first = (begin - from) / group, last = std::min(y.size(), (end - from) / group + 1);
    const std::size_t order = std::min(limits.order, first / (limits.rows_a_coefficient + 1));
    if (order < 8 || first >= last) continue;
    std::vector<bool> rows(y.size(), false);
    std::fill(rows.begin() + static_cast<std::ptrdiff_t>(order),
              rows.begin() + static_cast<std::ptrdiff_t>(first), true);
    const double noise_level = noise / std::sqrt(static_cast<double>(group));
    const std::vector<double> residual =
        predictionResidual(y, order, prediction(y, order, rows, noise_level));
    const auto power = [&](std::size_t a, std::size_t b) {
      double sum = 0.0;
      for (std::size_t i = a; i < b; ++i) sum += residual[i] * residual[i] / static_cast<double>(b - a);
      return std::sqrt(sum);
    };
    // The later half of the training samples, since the early ringing has larger residuals.
    most = std::max(most, power(first, last) / std::max(power((order + first) / 2, first), noise_level));
  }
  return most;
}

FreeDecayBreak freeDecayBreak(const std::vector<double>& response, std::size_t from, double noise,
                              const FreeDecayLimits& limits) {
  double largest = 0.0;
  for (const double v : response) largest = std::max(largest, std::abs(v));
  for (const std::size_t group : {1, 4, 16}) {
    if (from >= response.size()) break;
    FreeDecayBreak found = breakAt(averaged(response, from, group), group, largest,
                                   noise / std::sqrt(static_cast<double>(group)), limits);
    if (found.sample == 0) continue;
    found.sample = from + found.sample * group;
    return found;
  }
  return {};
}

}  // namespace smartmill
