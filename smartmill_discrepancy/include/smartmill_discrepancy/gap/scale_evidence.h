#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::discrepancy {

/// Evidence of one test on the change d between two models with residual r: sums over its channels.
struct ScaleEvidence {
  double squares = 0.0;   ///< d.d
  double product = 0.0;   ///< d.r
  double variance = 0.0;  ///< of d.r

  /// Adds one channel, values over the noise.
  /// @param change d @param residual r
  void add(const double* change, const double* residual, std::size_t size);
  /// @param power powerSpectrum() of the residual, computed once for many changes
  void add(const double* change, const double* residual, std::size_t size, const std::vector<double>& power);
};

/// Power spectrum with a Hann window; sums to about the sum of squares of the values.
std::vector<double> powerSpectrum(const double* values, std::size_t size);

/// Variance of the sum of d.r over tests, from the scatter of the tests about a common scale.
struct TestScatter {
  double variance = 0.0;
  double freedom = 0.0;  ///< degrees of freedom: effective number of tests less one
};
TestScatter testScatterOf(const std::vector<ScaleEvidence>& tests);

/// The same from the spectra, if the phases of d and r are independent.
double varianceOfLines(const std::vector<ScaleEvidence>& tests);

/// The larger of both.
double varianceOfProducts(const std::vector<ScaleEvidence>& tests);

}  // namespace smartmill::discrepancy
