#include "smartmill_loadmeter/calibration/fit.h"

#include <algorithm>
#include <cmath>

namespace smartmill::loadmeter {

FitResult fitLeastSquares(
    const std::function<void(const std::vector<double>& value, double* residuals)>& residuals,
    std::size_t count, const std::vector<FitParameter>& parameters, double tolerance) {
  const smartmill::fit::FunctionResiduals function(
      static_cast<Eigen::Index>(count), [&](const Eigen::VectorXd& at, Eigen::VectorXd& residual) {
        residuals(std::vector<double>(at.data(), at.data() + at.size()), residual.data());
      });
  smartmill::fit::Options options;
  options.orthogonal = true;  // friction terms resemble each other
  options.function_tolerance = tolerance;
  options.gradient_tolerance = 1e-16;
  const smartmill::fit::Result found = smartmill::fit::minimise(function, parameters, options);
  FitResult result;
  result.value.assign(found.value.data(), found.value.data() + found.value.size());
  result.squares = found.squares;
  result.converged = found.usable();
  const Eigen::MatrixXd covariance = found.covariance().matrix;
  result.covariance.assign(covariance.data(), covariance.data() + covariance.size());  // symmetric
  return result;
}

double bayesianInformationCriterion(double squares, std::size_t count, std::size_t unknowns,
                                    bool known_variance) {
  const double n = static_cast<double>(count), p = static_cast<double>(unknowns) * std::log(n);
  if (known_variance) return squares + p;
  return n * std::log(std::max(squares, 1e-300) / n) + p;
}

}  // namespace smartmill::loadmeter
