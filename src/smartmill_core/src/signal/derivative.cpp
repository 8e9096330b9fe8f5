#include "smartmill_core/signal/derivative.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace smartmill {

namespace {

// Weights of the samples around one, for a derivative per sample^order.
std::vector<double> kernel(int order, double deviation) {
  constexpr double REACH = 4.5;  // deviations
  const auto reach = static_cast<Eigen::Index>(std::ceil(REACH * deviation)) + 1;
  Eigen::MatrixXd powers(2 * reach + 1, order + 3);
  Eigen::VectorXd weights(2 * reach + 1);
  for (Eigen::Index k = 0; k < weights.size(); ++k) {
    const double x = static_cast<double>(k - reach) / deviation;
    weights[k] = std::exp(-0.5 * x * x);
    for (Eigen::Index p = 0; p < powers.cols(); ++p) powers(k, p) = std::pow(x, p);
  }
  const Eigen::MatrixXd weighted = powers.transpose() * weights.asDiagonal();
  const Eigen::MatrixXd coefficients = (weighted * powers).ldlt().solve(weighted);
  const double factorial = order;  // 1 and 2
  const Eigen::VectorXd row = factorial * coefficients.row(order).transpose() / std::pow(deviation, order);
  return {row.data(), row.data() + row.size()};
}

}  // namespace

std::vector<double> smoothedDerivative(const std::vector<double>& signal, double sample_rate, int order,
                                       double smoothing) {
  if (signal.size() < 2) return std::vector<double>(signal.size(), 0.0);
  const std::vector<double> weights = kernel(order, std::max(smoothing * sample_rate, 1.0));
  const auto n = static_cast<long>(signal.size()), reach = static_cast<long>(weights.size() / 2);
  const auto reflected = [&](long k) {
    const long inside = std::clamp(k, 0L, n - 1), mirror = std::clamp(2 * inside - k, 0L, n - 1);
    const double there = signal[static_cast<std::size_t>(mirror)];
    return order == 1 || inside == k ? there : 2.0 * signal[static_cast<std::size_t>(inside)] - there;
  };
  std::vector<double> padded;
  for (long k = -reach; k < n + reach; ++k) padded.push_back(reflected(k));
  const double scale = std::pow(sample_rate, order);
  std::vector<double> derivative(signal.size());
  for (std::size_t i = 0; i < signal.size(); ++i) {
    double sum = 0.0;
    for (std::size_t k = 0; k < weights.size(); ++k) sum += weights[k] * padded[i + k];
    derivative[i] = scale * sum;
  }
  return derivative;
}

}  // namespace smartmill
