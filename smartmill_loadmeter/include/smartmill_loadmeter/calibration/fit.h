#pragma once

#include <functional>
#include <vector>

#include "smartmill_core/fit/least_squares.h"

namespace smartmill::loadmeter {

using FitParameter = smartmill::fit::Parameter;

struct FitResult {
  std::vector<double> value;
  /// (J'J)^-1 row by row: the covariance when residuals are weighted to variance 1; zero rows for fixed
  /// unknowns and unknowns at a bound, infinite on the diagonal for unknowns that the residuals do not depend
  /// on.
  std::vector<double> covariance;
  double squares = 0.0;  ///< sum of squared residuals
  bool converged = false;

  double covarianceOf(std::size_t i, std::size_t j) const { return covariance[i * value.size() + j]; }
};

/// Least squares of residuals(value) within bounds, by central differences.
/// @param tolerance [1] relative change of the sum of squares at convergence.
/// @param residuals writes `count` residuals. @throws Error when they are not finite at the start.
FitResult fitLeastSquares(
    const std::function<void(const std::vector<double>& value, double* residuals)>& residuals,
    std::size_t count, const std::vector<FitParameter>& parameters, double tolerance = 1e-14);

/// Bayesian information criterion. @param squares sum of squared residuals, weighted to variance 1 when
/// `known_variance`; otherwise the variance is estimated from it.
double bayesianInformationCriterion(double squares, std::size_t count, std::size_t unknowns,
                                    bool known_variance);

}  // namespace smartmill::loadmeter
