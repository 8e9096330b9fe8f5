#include "fleet_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

namespace smartmill::loadmeter {

namespace {

/// Marginal covariance of a machine's cells, D + s^2 11', by the Woodbury identity.
struct CellCovariance {
  Eigen::VectorXd weight;  // of the inverse of D
  double shrink = 0.0;     // V^-1 = W - shrink w w'
  double log_determinant = 0.0;

  CellCovariance(const MachineCells& machine, double effect_variance, double batch_variance)
      : weight(machine.cells.size()) {
    for (std::size_t i = 0; i < machine.cells.size(); ++i) {
      const double variance = batch_variance + machine.cells[i].variance;
      weight[static_cast<Eigen::Index>(i)] = 1.0 / variance;
      log_determinant += std::log(variance);
    }
    const double sum = weight.sum();
    shrink = effect_variance / (1.0 + effect_variance * sum);
    log_determinant += std::log1p(effect_variance * sum);
  }
  Eigen::VectorXd solve(const Eigen::VectorXd& r) const {
    return weight.cwiseProduct(r) - shrink * weight.dot(r) * weight;
  }
};

double logLikelihood(const CellCovariance& covariance, const Eigen::VectorXd& r) {
  return -0.5 * (covariance.log_determinant + r.dot(covariance.solve(r)));
}

}  // namespace

FleetSolver::FleetSolver(const std::vector<FleetObservation>& observations, const FleetModelOptions& options)
    : options_(options), layout_(observations, options) {
}

double FleetSolver::outlierVariance(double usual) const {
  return usual + options_.outlier_std * options_.outlier_std;
}

Eigen::VectorXd FleetSolver::residualOf(const MachineCells& machine, const Eigen::VectorXd& effects) const {
  Eigen::VectorXd r(machine.cells.size());
  for (std::size_t i = 0; i < machine.cells.size(); ++i)
    r[static_cast<Eigen::Index>(i)] =
        machine.cells[i].mean - effects[static_cast<Eigen::Index>(machine.cells[i].group)];
  return r;
}

// Precision of the groups about the unknown mean of their material: (I - 11'/n) / tool^2.
Eigen::MatrixXd FleetSolver::toolPrior(double tool) const {
  const auto count = static_cast<Eigen::Index>(layout_.groups.size());
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::size_t material = layout_.groups[static_cast<std::size_t>(i)].material;
    const auto n =
        static_cast<double>(std::count_if(layout_.groups.begin(), layout_.groups.end(),
                                          [&](const FleetGroup& g) { return g.material == material; }));
    for (Eigen::Index j = 0; j < count; ++j) {
      if (layout_.groups[static_cast<std::size_t>(j)].material != material) continue;
      prior(i, j) = ((i == j ? 1.0 : 0.0) - 1.0 / n) / (tool * tool);
    }
  }
  return prior;
}

// Generalised least squares of the groups' effects; each machine's covariance is a mean of the usual and the
// outlier one by its outlier probability.
void FleetSolver::solveGroups(FleetPoint* point) const {
  const double usual = point->s.machine * point->s.machine, batch = point->s.batch * point->s.batch;
  const double wide = outlierVariance(usual);
  const auto count = static_cast<Eigen::Index>(layout_.groups.size());
  Eigen::MatrixXd normal = toolPrior(point->s.tool);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (std::size_t m = 0; m < layout_.machines.size(); ++m) {
    const std::vector<FleetCell>& cells = layout_.machines[m].cells;
    for (const auto& [share, variance] :
         {std::pair{1.0 - point->outlier[m], usual}, std::pair{point->outlier[m], wide}}) {
      if (share == 0.0) continue;
      const CellCovariance covariance(layout_.machines[m], variance, batch);
      double mean = 0.0;
      for (std::size_t i = 0; i < cells.size(); ++i)
        mean += covariance.weight[static_cast<Eigen::Index>(i)] * cells[i].mean;
      for (std::size_t i = 0; i < cells.size(); ++i) {
        const double w = covariance.weight[static_cast<Eigen::Index>(i)];
        const auto g = static_cast<Eigen::Index>(cells[i].group);
        right[g] += share * w * (cells[i].mean - covariance.shrink * mean);
        normal(g, g) += share * w;
        for (std::size_t j = 0; j < cells.size(); ++j)
          normal(g, static_cast<Eigen::Index>(cells[j].group)) -=
              share * covariance.shrink * w * covariance.weight[static_cast<Eigen::Index>(j)];
      }
    }
  }
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  point->groups = solver.solve(right);
  point->covariance = solver.solve(Eigen::MatrixXd::Identity(count, count));
  point->log_weight = -0.5 * solver.vectorD().array().abs().max(1e-300).log().sum();
}

// Alternates between groups and outlier probabilities, then computes the restricted likelihood of these
// deviations.
FleetPoint FleetSolver::solve(const FleetDeviations& s) const {
  constexpr int MAX_ITERATIONS = 12;
  constexpr double CONVERGED = 1e-4;
  FleetPoint point;
  point.s = s;
  point.outlier.assign(layout_.machines.size(), 0.0);
  const double batch = s.batch * s.batch, usual = s.machine * s.machine;
  const double wide = outlierVariance(usual);
  double likelihood = 0.0;
  for (int iteration = 0; iteration < MAX_ITERATIONS; ++iteration) {
    solveGroups(&point);
    double change = 0.0;
    likelihood = 0.0;
    for (std::size_t m = 0; m < layout_.machines.size(); ++m) {
      const Eigen::VectorXd r = residualOf(layout_.machines[m], point.groups);
      const double as_usual = std::log1p(-options_.outlier_probability) +
                              logLikelihood(CellCovariance(layout_.machines[m], usual, batch), r);
      const double as_outlier = options_.outlier_probability > 0.0
                                    ? std::log(options_.outlier_probability) +
                                          logLikelihood(CellCovariance(layout_.machines[m], wide, batch), r)
                                    : -std::numeric_limits<double>::infinity();
      const double top = std::max(as_usual, as_outlier);
      const double sum = std::exp(as_usual - top) + std::exp(as_outlier - top);
      likelihood += top + std::log(sum);
      const double outlier = std::exp(as_outlier - top) / sum;
      change = std::max(change, std::abs(outlier - point.outlier[m]));
      point.outlier[m] = outlier;
    }
    if (change < CONVERGED) break;
  }
  const double contrasts = static_cast<double>(layout_.groups.size() - layout_.materials.size());
  point.log_weight +=
      likelihood - contrasts * std::log(s.tool) - 0.5 * point.groups.dot(toolPrior(s.tool) * point.groups);
  return point;
}

// Best linear unbiased prediction for one component of the machine's effect.
void FleetSolver::addComponent(const MachineCells* machine, const FleetPoint& point, const EffectQuery& query,
                               double effect_variance, double share, Mixture* sum) const {
  const double batch = point.s.batch * point.s.batch;
  double mean = query.group.dot(point.groups);
  double variance = query.extra + effect_variance + (query.batch_of ? batch : 0.0);
  Eigen::VectorXd group = query.group;
  if (machine) {
    const CellCovariance covariance(*machine, effect_variance, batch);
    Eigen::VectorXd prior_covariance(machine->cells.size());
    for (std::size_t i = 0; i < machine->cells.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      prior_covariance[at] = effect_variance + (query.batch_of == machine->cells[i].group ? batch : 0.0);
    }
    const Eigen::VectorXd gain = covariance.solve(prior_covariance);
    mean += gain.dot(residualOf(*machine, point.groups));
    variance -= gain.dot(prior_covariance);
    for (std::size_t i = 0; i < machine->cells.size(); ++i)
      group[static_cast<Eigen::Index>(machine->cells[i].group)] -= gain[static_cast<Eigen::Index>(i)];
  }
  sum->add(share, mean, variance + group.dot(point.covariance * group));
}

void FleetSolver::predict(const MachineCells* machine, const FleetPoint& point, const EffectQuery& query,
                          Mixture* sum) const {
  const double usual = point.s.machine * point.s.machine;
  const double outlier = machine ? point.outlier[static_cast<std::size_t>(machine - layout_.machines.data())]
                                 : options_.outlier_probability;
  addComponent(machine, point, query, usual, point.log_weight * (1.0 - outlier), sum);
  addComponent(machine, point, query, outlierVariance(usual), point.log_weight * outlier, sum);
}

}  // namespace smartmill::loadmeter
