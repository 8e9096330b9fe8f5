#include "smartmill_core/fit/least_squares.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <ceres/iteration_callback.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <glog/logging.h>

#include "cost_function.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Distance to a bound, as share of the unknown's scale, that counts as at the bound.
constexpr double AT_BOUND = 1e-9;
// Share of an unknown in undetermined directions from which it counts as undetermined itself.
constexpr double UNDETERMINED_SHARE = 1e-6;

/// Reports progress to the caller; ends the fit on its request or after a failure.
class Reporter : public ceres::IterationCallback {
 public:
  Reporter(const Options& options, const ScaledResiduals& scaled) : options_(options), scaled_(scaled) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& now) override {
    if (scaled_.failure()) return ceres::SOLVER_ABORT;
    squares_ = std::min(squares_, 2.0 * now.cost);  // a rejected step reports its own cost
    if (!options_.progress || options_.progress({now.iteration, squares_})) return ceres::SOLVER_CONTINUE;
    cancelled_ = true;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }
  bool cancelled() const { return cancelled_; }

 private:
  const Options& options_;
  const ScaledResiduals& scaled_;
  double squares_ = std::numeric_limits<double>::infinity();
  bool cancelled_ = false;
};

/// Ceres logs failed steps through glog to the terminal; the result contains what matters.
void silence() {
  FLAGS_minloglevel = google::GLOG_FATAL;
}

ceres::Solver::Options solverOptions(const Options& options, Reporter* reporter) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = options.orthogonal ? ceres::DENSE_QR : ceres::DENSE_NORMAL_CHOLESKY;
  solver.max_num_iterations = options.iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.parameter_tolerance = options.parameter_tolerance;
  solver.gradient_tolerance = options.gradient_tolerance;
  solver.initial_trust_region_radius = options.trust_radius;
  if (options.costly_derivatives) {
    solver.line_search_interpolation_type = ceres::QUADRATIC;
    solver.max_num_line_search_step_size_iterations = 4;
  }
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;
  solver.update_state_every_iteration = false;
  solver.callbacks.push_back(reporter);
  return solver;
}

void bound(ceres::Problem* problem, double* x, const ScaledResiduals& scaled,
           const std::vector<Parameter>& parameters) {
  for (std::size_t k = 0; k < scaled.free().size(); ++k) {
    const Parameter& p = parameters[static_cast<std::size_t>(scaled.free()[k])];
    const int at = static_cast<int>(k);
    if (std::isfinite(p.low)) problem->SetParameterLowerBound(x, at, p.low / p.scale);
    if (std::isfinite(p.high)) problem->SetParameterUpperBound(x, at, p.high / p.scale);
  }
}

std::vector<double> startOf(const std::vector<Parameter>& parameters, const ScaledResiduals& scaled) {
  std::vector<double> x;
  for (const Index i : scaled.free()) {
    const Parameter& p = parameters[static_cast<std::size_t>(i)];
    x.push_back(std::clamp(p.start, p.low, p.high) / p.scale);
  }
  return x;
}

/// Residuals at the start. @throws Error where they are undefined
VectorXd residualAtStart(const Residuals& residuals, const VectorXd& start, const std::string& name) {
  VectorXd residual(residuals.count());
  if (!residuals.evaluate(start, &residual, nullptr))
    throw Error(name + ": the residuals are undefined at the start");
  for (Index i = 0; i < residual.size(); ++i) {
    if (!std::isfinite(residual[i]))
      throw Error(name + ": residual " + std::to_string(i) + " of " + std::to_string(residual.size()) +
                  " is not a finite number at the start");
  }
  return residual;
}

Ending endingOf(const ceres::Solver::Summary& summary, bool cancelled) {
  if (cancelled) return Ending::cancelled;
  if (!summary.IsSolutionUsable()) return Ending::failed;
  return summary.termination_type == ceres::NO_CONVERGENCE ? Ending::iterations_used : Ending::converged;
}

/// A result with the state to continue from it.
struct Solved {
  Result result;
  std::vector<bool> at_active_bound;  // per unknown: at a bound, with the gradient pointing outwards
};

/// Residuals and derivatives at the solution.
void describe(const ScaledResiduals& scaled, const ceres::CostFunction& cost,
              const std::vector<Parameter>& parameters, const std::vector<double>& x, Solved* solved) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Result& result = solved->result;
  RowMajor jacobian(result.residual.size(), static_cast<Index>(x.size()));
  const double* blocks[] = {x.data()};
  double* jacobians[] = {jacobian.data()};
  VectorXd residual(result.residual.size());
  if (!cost.Evaluate(blocks, residual.data(), jacobians)) {
    result.ending = Ending::failed;
    result.message = "the residuals have no derivatives at the final point";
    return;
  }
  result.residual = residual;
  result.squares = residual.squaredNorm();
  const VectorXd gradient = jacobian.transpose() * residual;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const Index i = scaled.free()[k], column = static_cast<Index>(k);
    const Parameter& p = parameters[static_cast<std::size_t>(i)];
    const double at = result.value[i], margin = AT_BOUND * p.scale;
    const bool low = at <= p.low + margin, high = at >= p.high - margin;
    solved->at_active_bound[static_cast<std::size_t>(i)] =
        (low && gradient[column] > 0.0) || (high && gradient[column] < 0.0);
    result.moves[static_cast<std::size_t>(i)] = !low && !high;
    if (!low && !high) result.jacobian.col(i) = jacobian.col(column) / p.scale;
  }
}

Solved solve(const Residuals& residuals, const std::vector<Parameter>& parameters, const Options& options) {
  const ScaledResiduals scaled(residuals, parameters);
  std::vector<double> x = startOf(parameters, scaled);
  Solved solved;
  Result& result = solved.result;
  result.value = scaled.valueOf(x.data());
  result.residual = residualAtStart(residuals, result.value, options.name);
  result.jacobian = MatrixXd::Zero(residuals.count(), static_cast<Index>(parameters.size()));
  result.squares = result.residual.squaredNorm();
  result.moves.assign(parameters.size(), false);
  solved.at_active_bound = result.moves;
  if (x.empty()) {
    result.ending = Ending::converged;
    result.message = "all unknowns are fixed";
    return solved;
  }
  ceres::CostFunction* cost = costFunction(
      scaled, residuals.count(), residuals.hasJacobian() ? Derivatives::given : Derivatives::central);
  ceres::Problem problem;
  problem.AddResidualBlock(cost, nullptr, x.data());  // which now owns the cost
  bound(&problem, x.data(), scaled, parameters);
  Reporter reporter(options, scaled);
  ceres::Solver::Summary summary;
  ceres::Solve(solverOptions(options, &reporter), &problem, &summary);
  if (scaled.failure()) std::rethrow_exception(scaled.failure());
  result.ending = endingOf(summary, reporter.cancelled());
  result.iterations = static_cast<int>(summary.iterations.size()) - 1;
  result.message = summary.message;
  if (!result.usable()) return solved;
  result.value = scaled.valueOf(x.data());
  describe(scaled, *cost, parameters, x, &solved);
  if (scaled.failure()) std::rethrow_exception(scaled.failure());
  return solved;
}

}  // namespace

FunctionResiduals::FunctionResiduals(Index count, Function function)
    : count_(count), function_(std::move(function)) {
}

bool FunctionResiduals::evaluate(const VectorXd& at, VectorXd* residual, MatrixXd*) const {
  function_(at, *residual);
  return true;
}

double Covariance::deviation(Index i) const {
  return std::sqrt(std::max(matrix(i, i), 0.0));
}

Covariance covarianceOf(const MatrixXd& jacobian, double tolerance) {
  const Index n = jacobian.cols();
  Covariance result;
  result.undetermined.assign(static_cast<std::size_t>(n), false);
  result.matrix = MatrixXd::Zero(n, n);
  if (n == 0) return result;
  const VectorXd size = jacobian.colwise().norm();
  MatrixXd unit = MatrixXd::Zero(std::max(jacobian.rows(), n), n);
  for (Index i = 0; i < n; ++i) {
    if (size[i] > 0.0) unit.col(i).head(jacobian.rows()) = jacobian.col(i) / size[i];
  }
  const linear::Svd svd = linear::svd(linear::triangleOf(unit));
  VectorXd undetermined_share = VectorXd::Zero(n);
  for (Index k = 0; k < n; ++k) {
    if (svd.values[k] > tolerance * svd.values[0]) {
      result.matrix += svd.v.col(k) * svd.v.col(k).transpose() / (svd.values[k] * svd.values[k]);
      ++result.rank;
    } else {
      undetermined_share += svd.v.col(k).cwiseAbs2();
    }
  }
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      if (size[i] > 0.0 && size[j] > 0.0) result.matrix(i, j) /= size[i] * size[j];
    }
  }
  for (Index i = 0; i < n; ++i) {
    if (undetermined_share[i] < UNDETERMINED_SHARE) continue;
    result.undetermined[static_cast<std::size_t>(i)] = true;
    result.matrix.row(i).setZero();
    result.matrix.col(i).setZero();
    result.matrix(i, i) = std::numeric_limits<double>::infinity();
  }
  return result;
}

MatrixXd propagated(const MatrixXd& map, const MatrixXd& covariance) {
  const Index n = covariance.cols();
  MatrixXd known = covariance;
  std::vector<Index> infinite;
  for (Index i = 0; i < n; ++i) {
    if (!std::isinf(covariance(i, i))) continue;
    infinite.push_back(i);
    known(i, i) = 0.0;
  }
  MatrixXd result = map * known * map.transpose();
  for (Index row = 0; row < map.rows(); ++row) {
    if (std::none_of(infinite.begin(), infinite.end(), [&](Index i) { return map(row, i) != 0.0; })) continue;
    result.row(row).setZero();
    result.col(row).setZero();
    result(row, row) = std::numeric_limits<double>::infinity();
  }
  return result;
}

Covariance Result::covariance() const {
  std::vector<Index> free;
  for (Index i = 0; i < jacobian.cols(); ++i) {
    if (moves[static_cast<std::size_t>(i)]) free.push_back(i);
  }
  const auto n = static_cast<Index>(free.size());
  MatrixXd part(jacobian.rows(), n);
  for (Index k = 0; k < n; ++k) part.col(k) = jacobian.col(free[static_cast<std::size_t>(k)]);
  const Covariance inner = covarianceOf(part);
  Covariance result;
  result.rank = inner.rank + jacobian.cols() - n;
  result.matrix = MatrixXd::Zero(jacobian.cols(), jacobian.cols());
  result.undetermined.assign(static_cast<std::size_t>(jacobian.cols()), false);
  for (Index k = 0; k < n; ++k) {
    const Index i = free[static_cast<std::size_t>(k)];
    result.undetermined[static_cast<std::size_t>(i)] = inner.undetermined[static_cast<std::size_t>(k)];
    for (Index l = 0; l < n; ++l) result.matrix(i, free[static_cast<std::size_t>(l)]) = inner.matrix(k, l);
  }
  return result;
}

Result minimise(const Residuals& residuals, const std::vector<Parameter>& parameters,
                const Options& options) {
  silence();
  const Solved first = solve(residuals, parameters, options);
  const auto at_active_bound = std::count(first.at_active_bound.begin(), first.at_active_bound.end(), true);
  if (!options.finish_at_bounds || at_active_bound == 0 || first.result.ending != Ending::converged)
    return first.result;
  // Ceres evaluates its steps by their predicted decrease without bounds, and ends early where unknowns are
  // pushed against theirs. The fit continues with the other unknowns.
  std::vector<Parameter> held = parameters;
  for (std::size_t i = 0; i < held.size(); ++i) {
    held[i].start = first.result.value[static_cast<Index>(i)];
    if (first.at_active_bound[i]) held[i].low = held[i].high = held[i].start;
  }
  Result second = solve(residuals, held, options).result;
  if (!second.usable() || second.squares > first.result.squares) return first.result;
  second.iterations += first.result.iterations;
  return second;
}

}  // namespace smartmill::fit
