#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::discrepancy {

/// What one test says of two models, or of a direction in which they differ: sums over its channels.
struct AskedTest {
  double squares = 0.0;   ///< d.d
  double product = 0.0;   ///< d.r
  double variance = 0.0;  ///< of the product

  /// One channel, values over the noise. @param between d @param left r
  void add(const double* between, const double* left, std::size_t size);
  /// @param power of what is left, by powerOf(): for many directions beside the same
  void add(const double* between, const double* left, std::size_t size, const std::vector<double>& power);
};

/// Squares by frequency behind a Hann window, of which there are as many as those of the values.
std::vector<double> powerOf(const double* values, std::size_t size);

/// Variance of the sum of the products over tests as these scatter about a common share of d.
struct Scatter {
  double variance = 0.0;
  double freedom = 0.0;  ///< degrees: as many tests as tell so much evenly, less one
};
Scatter scatterOf(const std::vector<AskedTest>& tests);

/// The same of what is left at random phases.
double varianceOfLines(const std::vector<AskedTest>& tests);

/// The larger of both.
double varianceOfProducts(const std::vector<AskedTest>& tests);

}  // namespace smartmill::discrepancy
