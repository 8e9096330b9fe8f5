#include "smartmill_discrepancy/gap/scale_evidence.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"

namespace smartmill::discrepancy {

// The mean square of the window is 3/8.
std::vector<double> powerSpectrum(const double* values, std::size_t size) {
  // A window would remove most of a few values, and each is a line of its own.
  constexpr std::size_t FEW = 16;
  if (size < FEW) {
    std::vector<double> each;
    for (std::size_t i = 0; i < size; ++i) each.push_back(values[i] * values[i]);
    return each;
  }
  std::vector<double> windowed = hannWindow(size), squares;
  for (std::size_t i = 0; i < size; ++i) windowed[i] *= values[i];
  for (const std::complex<double>& x : fourier(windowed)) {
    const bool single = squares.empty() || 2 * squares.size() == size;
    squares.push_back((single ? 1.0 : 2.0) * std::norm(x) / (0.375 * static_cast<double>(size)));
  }
  return squares;
}

void ScaleEvidence::add(const double* change, const double* residual, std::size_t size) {
  add(change, residual, size, powerSpectrum(residual, size));
}

// The window spreads a line over bins so that the products of two lines' bins sum to half the product of
// their squares, the variance at a random phase. Noise of unit variance, with two degrees of freedom per bin,
// is counted twice.
void ScaleEvidence::add(const double* change, const double* residual, std::size_t size,
                        const std::vector<double>& power) {
  double own = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    own += change[i] * change[i];
    product += change[i] * residual[i];
  }
  if (own <= 0.0) return;
  squares += own;
  const std::vector<double> change_power = powerSpectrum(change, size);
  const double sum = std::inner_product(power.begin(), power.end(), change_power.begin(), 0.0);
  variance += std::max(sum - own, 0.5 * sum);
}

// The common scale depends on each test in proportion to its squares, which reduces the expected square of
// its residual.
TestScatter testScatterOf(const std::vector<ScaleEvidence>& tests) {
  double squares = 0.0, product = 0.0, even = 0.0;
  for (const ScaleEvidence& t : tests) {
    squares += t.squares;
    product += t.product;
    even += t.squares * t.squares;
  }
  TestScatter scatter;
  for (const ScaleEvidence& t : tests) {
    const double others = squares - t.squares;
    if (others > 0.0)
      scatter.variance += std::pow(t.product - t.squares * product / squares, 2) * squares / others;
  }
  if (even > 0.0) scatter.freedom = squares * squares / even - 1.0;
  return scatter;
}

double varianceOfLines(const std::vector<ScaleEvidence>& tests) {
  return std::accumulate(tests.begin(), tests.end(), 0.0,
                         [](double sum, const ScaleEvidence& t) { return sum + t.variance; });
}

double varianceOfProducts(const std::vector<ScaleEvidence>& tests) {
  return std::max(varianceOfLines(tests), testScatterOf(tests).variance);
}

}  // namespace smartmill::discrepancy
