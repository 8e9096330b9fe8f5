#pragma once

#include <functional>
#include <vector>

#include "smartmill_core/fit/least_squares.h"

namespace smartmill::loadmeter {

using FitParameter = smartmill::fit::Parameter;

struct FitResult {
  std::vector<double> value;
  /// (J'J)^-1 row by row: the covariance when residuals are weighted to variance 1; zero rows where held or
  /// at a bound, infinite on the diagonal where the residuals do not tell an unknown.
  std::vector<double> covariance;
  double squares = 0.0;  ///< sum of squared residuals
  bool converged = false;

  double covarianceOf(std::size_t i, std::size_t j) const { return covariance[i * value.size() + j]; }
};

/// Least squares of residuals(value) within bounds, by central differences.
/// @param tolerance [1] relative change of the squares at which it ends.
/// @param residuals fills `count` numbers. @throws Error when they are not finite at the start.
FitResult fit(const std::function<void(const std::vector<double>& value, double* residuals)>& residuals,
              std::size_t count, const std::vector<FitParameter>& parameters, double tolerance = 1e-14);

/// Bayesian information criterion of a fit whose residuals are weighted to variance 1 when
/// `known_variance`, else of unknown variance, estimated from `squares`.
double informationCriterion(double squares, std::size_t count, std::size_t unknowns, bool known_variance);

}  // namespace smartmill::loadmeter
