#include "smartmill_discrepancy/gap/asked.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"

namespace smartmill::discrepancy {

// The mean square of the window is 3/8.
std::vector<double> powerOf(const double* values, std::size_t size) {
  // Of a few values a window would leave nothing, and no two of them are of one line.
  constexpr std::size_t FEW = 16;
  if (size < FEW) {
    std::vector<double> each;
    for (std::size_t i = 0; i < size; ++i) each.push_back(values[i] * values[i]);
    return each;
  }
  std::vector<double> part = hannWindow(size), squares;
  for (std::size_t i = 0; i < size; ++i) part[i] *= values[i];
  for (const std::complex<double>& x : fourier(part)) {
    const bool single = squares.empty() || 2 * squares.size() == size;
    squares.push_back((single ? 1.0 : 2.0) * std::norm(x) / (0.375 * static_cast<double>(size)));
  }
  return squares;
}

void AskedTest::add(const double* between, const double* left, std::size_t size) {
  add(between, left, size, powerOf(left, size));
}

// The window spreads a line over bins in such shares that the products of two lines' bins add up to half the
// product of their squares, the variance at a random phase. Noise of unit variance, two degrees of freedom a
// bin, is counted twice by that.
void AskedTest::add(const double* between, const double* left, std::size_t size,
                    const std::vector<double>& power) {
  double own = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    own += between[i] * between[i];
    product += between[i] * left[i];
  }
  if (own <= 0.0) return;
  squares += own;
  const std::vector<double> of_between = powerOf(between, size);
  const double sum = std::inner_product(power.begin(), power.end(), of_between.begin(), 0.0);
  variance += std::max(sum - own, 0.5 * sum);
}

// The common share follows a test by that test's part of the squares: by just that part the square of what is
// left of it is less than its variance.
Scatter scatterOf(const std::vector<AskedTest>& tests) {
  double squares = 0.0, product = 0.0, even = 0.0;
  for (const AskedTest& t : tests) {
    squares += t.squares;
    product += t.product;
    even += t.squares * t.squares;
  }
  Scatter scatter;
  for (const AskedTest& t : tests) {
    const double others = squares - t.squares;
    if (others > 0.0)
      scatter.variance += std::pow(t.product - t.squares * product / squares, 2) * squares / others;
  }
  if (even > 0.0) scatter.freedom = squares * squares / even - 1.0;
  return scatter;
}

double varianceOfLines(const std::vector<AskedTest>& tests) {
  return std::accumulate(tests.begin(), tests.end(), 0.0,
                         [](double sum, const AskedTest& t) { return sum + t.variance; });
}

double varianceOfProducts(const std::vector<AskedTest>& tests) {
  return std::max(varianceOfLines(tests), scatterOf(tests).variance);
}

}  // namespace smartmill::discrepancy
