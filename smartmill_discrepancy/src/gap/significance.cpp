#include "smartmill_discrepancy/gap/significance.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace smartmill::discrepancy {
namespace {

constexpr double LEAST_P = 1e-300;

}  // namespace

double chiSquareTail(double value, std::size_t freedom) {
  // exp(-x/2) sum (x/2)^k / k!, in logarithms.
  const double half = 0.5 * value;
  if (half <= 0.0) return 1.0;
  double largest = -1e308, sum = 0.0;
  std::vector<double> logs;
  for (std::size_t k = 0; k < std::max<std::size_t>(freedom / 2, 1); ++k) {
    logs.push_back(static_cast<double>(k) * std::log(half) - std::lgamma(static_cast<double>(k) + 1.0) -
                   half);
    largest = std::max(largest, logs.back());
  }
  for (const double l : logs) sum += std::exp(l - largest);
  return std::clamp(std::exp(largest + std::log(sum)), LEAST_P, 1.0);
}

std::vector<double> falseDiscoveryRates(const std::vector<double>& p_values) {
  const std::size_t n = p_values.size();
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return p_values[a] < p_values[b]; });
  std::vector<double> rates(n);
  double least = 1.0;
  for (std::size_t k = n; k-- > 0;) {
    least = std::min(least, p_values[order[k]] * static_cast<double>(n) / static_cast<double>(k + 1));
    rates[order[k]] = std::max(least, LEAST_P);
  }
  return rates;
}

}  // namespace smartmill::discrepancy
