#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace smartmill::loadmeter {

/// [1] Factor of the standard deviations of a fit (Birge 1932): the root of the sum of the squared residuals,
/// over their standard deviations, per degree of freedom if the sum is beyond what 99 % of such sets show
/// (chi square), else 1. @param freedom degrees of freedom; below 1 the factor is 1
double widening(double squares, double freedom);

/// Linear least squares with known standard deviations, without values that deviate from the others.
struct WeightedFit {
  struct Refused {
    std::size_t row = 0;
    double deviation = 0.0;  ///< [unit of the values] from the fit
    double sigmas = 0.0;     ///< [1] standard deviations
  };
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
  std::vector<double> weight;    ///< [1 / unit^2] of each row, 0: refused
  std::vector<Refused> refused;  ///< in the order of refusal, largest first
  double widened = 1.0;          ///< [1] factor of the standard deviations by the scatter of the values
  std::string problem;           ///< why there is no fit; one line, empty: there is one

  bool found() const { return problem.empty(); }
};

/// Minimises sum ((y - X b) / s)^2. The row with the largest residual in its own standard deviations,
/// s sqrt(1 - leverage), is refused while that is above `limit`; at most a quarter of the rows, and only if
/// more rows than unknowns remain. The standard deviations are multiplied by widening().
/// @param design X, full rank. @param what the rows are, plural, for the reason
WeightedFit fitWeighted(const Eigen::MatrixXd& design, const Eigen::VectorXd& value,
                        const Eigen::VectorXd& std_dev, double limit, const std::string& what);

}  // namespace smartmill::loadmeter
