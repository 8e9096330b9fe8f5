#include "smartmill_loadmeter/calibration/fit.h"

#include <algorithm>
#include <cmath>

#include <ceres/ceres.h>
#include <Eigen/Dense>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

using Residuals = std::function<void(const std::vector<double>&, double*)>;

std::vector<std::size_t> freeOf(const std::vector<FitParameter>& parameters) {
  std::vector<std::size_t> free;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].high > parameters[i].low) free.push_back(i);
  }
  return free;
}

// Ceres sees the free unknowns in units of their scale.
struct Cost {
  const Residuals& residuals;
  const std::vector<FitParameter>& parameters;
  std::vector<std::size_t> free;

  std::vector<double> valueOf(const double* x) const {
    std::vector<double> value;
    for (const FitParameter& p : parameters) value.push_back(p.start);
    for (std::size_t k = 0; k < free.size(); ++k) value[free[k]] = x[k] * parameters[free[k]].scale;
    return value;
  }
  bool operator()(double const* const* x, double* out) const {
    residuals(valueOf(x[0]), out);
    return true;
  }
};

}  // namespace

FitResult fit(const Residuals& residuals, std::size_t count, const std::vector<FitParameter>& parameters,
              double tolerance) {
  const Cost cost{residuals, parameters, freeOf(parameters)};
  const std::size_t n = cost.free.size();
  std::vector<double> x(std::max<std::size_t>(n, 1));
  for (std::size_t k = 0; k < n; ++k) {
    const FitParameter& p = parameters[cost.free[k]];
    x[k] = std::clamp(p.start, p.low, p.high) / p.scale;
  }
  std::vector<double> rest(count);
  cost.residuals(cost.valueOf(x.data()), rest.data());
  for (const double r : rest) {
    if (!std::isfinite(r)) throw Error("fit: a residual at the start is not a finite number");
  }
  FitResult result;
  result.converged = true;
  if (n > 0) {
    auto* function = new ceres::DynamicNumericDiffCostFunction<Cost, ceres::CENTRAL>(new Cost(cost));
    function->AddParameterBlock(static_cast<int>(n));
    function->SetNumResiduals(static_cast<int>(count));
    ceres::Problem problem;
    problem.AddResidualBlock(function, nullptr, x.data());
    for (std::size_t k = 0; k < n; ++k) {
      const FitParameter& p = parameters[cost.free[k]];
      if (std::isfinite(p.low))
        problem.SetParameterLowerBound(x.data(), static_cast<int>(k), p.low / p.scale);
      if (std::isfinite(p.high)) {
        problem.SetParameterUpperBound(x.data(), static_cast<int>(k), p.high / p.scale);
      }
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = 200;
    options.function_tolerance = tolerance;
    options.parameter_tolerance = 1e-12;
    options.gradient_tolerance = 1e-16;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    result.converged = summary.IsSolutionUsable();
  }
  result.value = cost.valueOf(x.data());
  cost.residuals(result.value, rest.data());
  for (const double r : rest) result.squares += r * r;

  const std::size_t all = parameters.size();
  result.covariance.assign(all * all, 0.0);
  std::vector<std::size_t> inside;
  for (std::size_t k = 0; k < n; ++k) {
    const FitParameter& p = parameters[cost.free[k]];
    const double margin = 1e-9 * p.scale, at = result.value[cost.free[k]];
    if (at > p.low + margin && at < p.high - margin) inside.push_back(k);
  }
  Eigen::MatrixXd jacobian(static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(inside.size()));
  std::vector<double> below(count);
  for (std::size_t c = 0; c < inside.size(); ++c) {
    std::vector<double> moved = x;
    const double step = 1e-5 * std::max(1.0, std::abs(x[inside[c]]));
    moved[inside[c]] = x[inside[c]] + step;
    cost.residuals(cost.valueOf(moved.data()), rest.data());
    moved[inside[c]] = x[inside[c]] - step;
    cost.residuals(cost.valueOf(moved.data()), below.data());
    for (std::size_t i = 0; i < count; ++i) {
      jacobian(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) =
          (rest[i] - below[i]) / (2.0 * step);
    }
  }
  if (!inside.empty()) {
    const Eigen::MatrixXd inverse =
        (jacobian.transpose() * jacobian).completeOrthogonalDecomposition().pseudoInverse();
    for (std::size_t a = 0; a < inside.size(); ++a) {
      for (std::size_t b = 0; b < inside.size(); ++b) {
        const std::size_t i = cost.free[inside[a]], j = cost.free[inside[b]];
        result.covariance[i * all + j] = inverse(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) *
                                         parameters[i].scale * parameters[j].scale;
      }
    }
  }
  return result;
}

double informationCriterion(double squares, std::size_t count, std::size_t unknowns, bool known_variance) {
  const double n = static_cast<double>(count), p = static_cast<double>(unknowns) * std::log(n);
  if (known_variance) return squares + p;
  return n * std::log(std::max(squares, 1e-300) / n) + p;
}

}  // namespace smartmill::loadmeter
