#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace smartmill::loadmeter {

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
/// more rows than unknowns remain. If the scatter of the others is beyond what 99 % of such sets show (chi
/// square), the standard deviations are multiplied by its root (Birge 1932).
/// @param design X, full rank. @param what the rows are, plural, for the reason
WeightedFit fitWeighted(const Eigen::MatrixXd& design, const Eigen::VectorXd& value,
                        const Eigen::VectorXd& std_dev, double limit, const std::string& what);

}  // namespace smartmill::loadmeter
