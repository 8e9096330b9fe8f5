#include "smartmill_loadmeter/database/fleet_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

constexpr double DEFAULT_STD = 0.05;  // [1] standard deviation of an observation without one
// Scales of the half-normal priors of the deviations [1]; they matter with two or three machines.
constexpr FleetDeviations PRIOR_SCALE{0.15, 0.1, 0.3, 0.0};
constexpr double LEAST_STD = 1e-9;  // [1] smallest standard deviation of a cell

/// Observations of one group by one machine.
struct Cell {
  std::size_t group = 0;
  int count = 0;
  double mean = 0.0, variance = 0.0;  // of the logarithm, weighted
};

struct Machine {
  std::string name;
  std::vector<Cell> cells;
  std::vector<std::size_t> observations;
};

struct Group {
  std::string tool;
  std::size_t material = 0;
};

/// Marginal covariance of a machine's cells, D + s^2 11', by the Woodbury identity.
struct CellCovariance {
  Eigen::VectorXd weight;  // of the inverse of D
  double shrink = 0.0;     // V^-1 = W - shrink w w'
  double log_determinant = 0.0;

  CellCovariance(const Machine& machine, double effect_variance, double batch_variance)
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

/// Grid point of the deviations: weight, groups' effects, and outlier probability of each machine.
struct GridPoint {
  FleetDeviations s;
  double log_weight = 0.0;
  Eigen::VectorXd groups;
  Eigen::MatrixXd covariance;
  std::vector<double> outlier;
};

double logLikelihood(const CellCovariance& covariance, const Eigen::VectorXd& r) {
  return -0.5 * (covariance.log_determinant + r.dot(covariance.solve(r)));
}

}  // namespace

struct FleetModel::Impl {
  FleetModelOptions options;
  std::vector<FleetObservation> observations;
  std::vector<std::string> materials;
  std::vector<Group> groups;
  std::vector<Machine> machines;
  std::vector<std::size_t> group_of, machine_of;  // of each observation
  double noise = 0.0;
  std::vector<GridPoint> points;

  std::optional<std::size_t> materialAt(const std::string& name) const {
    const auto at = std::find(materials.begin(), materials.end(), name);
    if (at == materials.end()) return std::nullopt;
    return static_cast<std::size_t>(at - materials.begin());
  }
  const Machine* machineAt(const std::string& name) const {
    const auto at =
        std::find_if(machines.begin(), machines.end(), [&](const Machine& m) { return m.name == name; });
    return at == machines.end() ? nullptr : &*at;
  }

  static double ownVariance(const FleetObservation& o) {
    const double relative = std::isfinite(o.std_dev) ? o.std_dev / o.value : DEFAULT_STD;
    return relative * relative;
  }

  void indexObservations();
  void estimateNoise();
  void fillCells();
  Eigen::VectorXd residualOf(const Machine& machine, const Eigen::VectorXd& effects) const;
  Eigen::MatrixXd toolPrior(double tool) const;
  void solveGroups(GridPoint* point) const;
  GridPoint solve(const FleetDeviations& s) const;
  void integrate();
  void evaluateGrid(const std::array<std::vector<double>, 3>& axes, bool last);
};

void FleetModel::Impl::indexObservations() {
  for (const FleetObservation& o : observations) {
    if (!(o.value > 0.0) || !std::isfinite(o.value))
      throw Error("fleet: value of '" + o.machine + "' in '" + o.material +
                  "': expected a finite number > 0");
    auto material = materialAt(o.material);
    if (!material) {
      materials.push_back(o.material);
      material = materials.size() - 1;
    }
    std::size_t g = 0;
    while (g < groups.size() && (groups[g].material != *material || groups[g].tool != o.tool)) ++g;
    if (g == groups.size()) groups.push_back({o.tool, *material});
    std::size_t m = 0;
    while (m < machines.size() && machines[m].name != o.machine) ++m;
    if (m == machines.size()) machines.push_back({o.machine, {}, {}});
    machines[m].observations.push_back(group_of.size());
    group_of.push_back(g);
    machine_of.push_back(m);
  }
  if (observations.empty()) throw Error("fleet: no observations");
}

// Scatter within cells beyond the stated deviations, by the method of moments: E sum (y - mean)^2 = sum (1 -
// 1/n) (s^2 + noise^2).
void FleetModel::Impl::estimateNoise() {
  if (options.known) {
    noise = options.known->noise;
    return;
  }
  std::map<std::pair<std::size_t, std::size_t>, std::vector<std::size_t>> cells;
  for (std::size_t i = 0; i < observations.size(); ++i) cells[{machine_of[i], group_of[i]}].push_back(i);
  double scatter = 0.0, stated = 0.0, freedom = 0.0;
  for (const auto& [key, members] : cells) {
    const double n = static_cast<double>(members.size());
    double mean = 0.0;
    for (const std::size_t i : members) mean += std::log(observations[i].value) / n;
    for (const std::size_t i : members) {
      scatter += std::pow(std::log(observations[i].value) - mean, 2);
      stated += (1.0 - 1.0 / n) * ownVariance(observations[i]);
    }
    freedom += n - 1.0;
  }
  if (freedom > 0.0) noise = std::sqrt(std::max(0.0, (scatter - stated) / freedom));
}

void FleetModel::Impl::fillCells() {
  for (Machine& machine : machines) {
    for (const std::size_t i : machine.observations) {
      auto cell = std::find_if(machine.cells.begin(), machine.cells.end(),
                               [&](const Cell& c) { return c.group == group_of[i]; });
      if (cell == machine.cells.end()) cell = machine.cells.insert(machine.cells.end(), Cell{group_of[i]});
      const double variance = std::max(ownVariance(observations[i]) + noise * noise, LEAST_STD * LEAST_STD);
      // At first sums of weights and of weighted values.
      ++cell->count;
      cell->variance += 1.0 / variance;
      cell->mean += std::log(observations[i].value) / variance;
    }
    for (Cell& cell : machine.cells) {
      cell.mean /= cell.variance;
      cell.variance = 1.0 / cell.variance;
    }
  }
}

Eigen::VectorXd FleetModel::Impl::residualOf(const Machine& machine, const Eigen::VectorXd& effects) const {
  Eigen::VectorXd r(machine.cells.size());
  for (std::size_t i = 0; i < machine.cells.size(); ++i)
    r[static_cast<Eigen::Index>(i)] =
        machine.cells[i].mean - effects[static_cast<Eigen::Index>(machine.cells[i].group)];
  return r;
}

// Precision of the groups about the unknown mean of their material: (I - 11'/n) / tool^2.
Eigen::MatrixXd FleetModel::Impl::toolPrior(double tool) const {
  const auto count = static_cast<Eigen::Index>(groups.size());
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::size_t material = groups[static_cast<std::size_t>(i)].material;
    const auto n = static_cast<double>(
        std::count_if(groups.begin(), groups.end(), [&](const Group& g) { return g.material == material; }));
    for (Eigen::Index j = 0; j < count; ++j) {
      if (groups[static_cast<std::size_t>(j)].material != material) continue;
      prior(i, j) = ((i == j ? 1.0 : 0.0) - 1.0 / n) / (tool * tool);
    }
  }
  return prior;
}

// Generalised least squares of the groups' effects; each machine's covariance is a mean of the usual and the
// outlier one by its outlier probability.
void FleetModel::Impl::solveGroups(GridPoint* point) const {
  const double usual = point->s.machine * point->s.machine, batch = point->s.batch * point->s.batch;
  const double wide = usual + options.outlier_std * options.outlier_std;
  const auto count = static_cast<Eigen::Index>(groups.size());
  Eigen::MatrixXd normal = toolPrior(point->s.tool);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (std::size_t m = 0; m < machines.size(); ++m) {
    const std::vector<Cell>& cells = machines[m].cells;
    for (const auto& [share, variance] :
         {std::pair{1.0 - point->outlier[m], usual}, std::pair{point->outlier[m], wide}}) {
      if (share == 0.0) continue;
      const CellCovariance covariance(machines[m], variance, batch);
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
GridPoint FleetModel::Impl::solve(const FleetDeviations& s) const {
  constexpr int MAX_ITERATIONS = 12;
  constexpr double CONVERGED = 1e-4;
  GridPoint point;
  point.s = s;
  point.outlier.assign(machines.size(), 0.0);
  const double batch = s.batch * s.batch, usual = s.machine * s.machine;
  const double wide = usual + options.outlier_std * options.outlier_std;
  double likelihood = 0.0;
  for (int iteration = 0; iteration < MAX_ITERATIONS; ++iteration) {
    solveGroups(&point);
    double change = 0.0;
    likelihood = 0.0;
    for (std::size_t m = 0; m < machines.size(); ++m) {
      const Eigen::VectorXd r = residualOf(machines[m], point.groups);
      const double as_usual = std::log1p(-options.outlier_probability) +
                              logLikelihood(CellCovariance(machines[m], usual, batch), r);
      const double as_outlier = options.outlier_probability > 0.0
                                    ? std::log(options.outlier_probability) +
                                          logLikelihood(CellCovariance(machines[m], wide, batch), r)
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
  const double contrasts = static_cast<double>(groups.size() - materials.size());
  point.log_weight +=
      likelihood - contrasts * std::log(s.tool) - 0.5 * point.groups.dot(toolPrior(s.tool) * point.groups);
  return point;
}

void FleetModel::Impl::evaluateGrid(const std::array<std::vector<double>, 3>& axes, bool last) {
  points.clear();
  for (const double machine : axes[0]) {
    for (const double batch : axes[1]) {
      for (const double tool : axes[2]) {
        points.push_back(solve({machine, batch, tool, noise}));
        // The axes are logarithmic.
        points.back().log_weight +=
            std::log(machine * batch * tool) -
            0.5 * (std::pow(machine / PRIOR_SCALE.machine, 2) + std::pow(batch / PRIOR_SCALE.batch, 2) +
                   std::pow(tool / PRIOR_SCALE.tool, 2));
      }
    }
  }
  double top = -std::numeric_limits<double>::infinity(), sum = 0.0;
  for (const GridPoint& point : points) top = std::max(top, point.log_weight);
  for (GridPoint& point : points) sum += point.log_weight = std::exp(point.log_weight - top);
  for (GridPoint& point : points) point.log_weight /= sum;
  if (!last) return;
  constexpr double SMALL = 1e-4;  // grid points with a smaller weight are removed
  points.erase(
      std::remove_if(points.begin(), points.end(), [](const GridPoint& n) { return n.log_weight < SMALL; }),
      points.end());
}

// Integrates over a wide grid, then over one about its mean. Afterwards log_weight holds the weight itself.
void FleetModel::Impl::integrate() {
  if (options.known) {
    points = {solve(*options.known)};
    points[0].log_weight = 1.0;
    return;
  }
  const std::array<std::pair<double, double>, 3> wide{{{2e-3, 0.5}, {5e-4, 0.3}, {3e-3, 1.0}}};
  constexpr int COARSE = 8, FINE = 7;
  std::array<std::vector<double>, 3> axes;
  for (std::size_t a = 0; a < 3; ++a) {
    for (int i = 0; i < COARSE; ++i)
      axes[a].push_back(wide[a].first * std::pow(wide[a].second / wide[a].first, i / (COARSE - 1.0)));
  }
  evaluateGrid(axes, false);
  const std::array<double FleetDeviations::*, 3> members{&FleetDeviations::machine, &FleetDeviations::batch,
                                                         &FleetDeviations::tool};
  for (std::size_t a = 0; a < 3; ++a) {
    double mean = 0.0, square = 0.0;
    for (const GridPoint& point : points) {
      const double x = std::log(point.s.*members[a]);
      mean += point.log_weight * x;
      square += point.log_weight * x * x;
    }
    const double step = std::log(wide[a].second / wide[a].first) / (COARSE - 1.0);
    const double spread = std::max(0.5 * step, std::sqrt(std::max(0.0, square - mean * mean)));
    axes[a].clear();
    for (int i = 0; i < FINE; ++i)
      axes[a].push_back(std::exp(mean + spread * (4.0 * i / (FINE - 1.0) - 2.0)));
  }
  evaluateGrid(axes, true);
}

FleetModel::FleetModel(const std::vector<FleetObservation>& observations, const FleetModelOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  impl_->observations = observations;
  impl_->indexObservations();
  impl_->estimateNoise();
  impl_->fillCells();
  impl_->integrate();
}
FleetModel::~FleetModel() = default;
FleetModel::FleetModel(FleetModel&&) noexcept = default;

namespace {

/// First two moments of a mixture of normal distributions.
struct Mixture {
  double weight = 0.0, mean = 0.0, square = 0.0;

  void add(double share, double value, double variance) {
    weight += share;
    mean += share * value;
    square += share * (variance + value * value);
  }
  double value() const { return mean / weight; }
  double variance() const { return std::max(0.0, square / weight - value() * value()); }
};

/// Combination of effects to predict: groups, the machine's effect, and a batch of a group.
struct EffectQuery {
  Eigen::VectorXd group;                // weights of the groups' effects
  double extra = 0.0;                   // [1] variance of unobserved effects
  double machine = 1.0;                 // weight of the machine's effect
  std::optional<std::size_t> batch_of;  // group whose batch effect is included
};

/// Adds the best linear unbiased prediction for one component of the machine's effect (Henderson).
void addPrediction(const Machine* machine, const GridPoint& point, const EffectQuery& query,
                   double effect_variance, double share, Mixture* sum) {
  const double batch = point.s.batch * point.s.batch;
  double mean = query.group.dot(point.groups);
  double variance = query.extra + query.machine * effect_variance + (query.batch_of ? batch : 0.0);
  Eigen::VectorXd group = query.group;
  if (machine) {
    const CellCovariance covariance(*machine, effect_variance, batch);
    Eigen::VectorXd prior_covariance(machine->cells.size()), residual_of(machine->cells.size());
    for (std::size_t i = 0; i < machine->cells.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      prior_covariance[at] =
          query.machine * effect_variance + (query.batch_of == machine->cells[i].group ? batch : 0.0);
      residual_of[at] =
          machine->cells[i].mean - point.groups[static_cast<Eigen::Index>(machine->cells[i].group)];
    }
    const Eigen::VectorXd gain = covariance.solve(prior_covariance);
    mean += gain.dot(residual_of);
    variance -= gain.dot(prior_covariance);
    for (std::size_t i = 0; i < machine->cells.size(); ++i)
      group[static_cast<Eigen::Index>(machine->cells[i].group)] -= gain[static_cast<Eigen::Index>(i)];
  }
  sum->add(share, mean, variance + group.dot(point.covariance * group));
}

}  // namespace

std::optional<FleetPrediction> FleetModel::predict(const std::string& machine, const std::string& material,
                                                   const std::string& tool) const {
  const auto material_at = impl_->materialAt(material);
  if (!material_at) return std::nullopt;
  const Machine* own = impl_->machineAt(machine);
  const auto count = static_cast<Eigen::Index>(impl_->groups.size());
  EffectQuery query;
  query.group = Eigen::VectorXd::Zero(count);
  FleetPrediction found;
  std::size_t same_material = 0;
  for (std::size_t g = 0; g < impl_->groups.size(); ++g) {
    if (impl_->groups[g].material != *material_at) continue;
    ++same_material;
    if (impl_->groups[g].tool == tool) query.batch_of = g;
  }
  found.known_group = query.batch_of.has_value();
  for (std::size_t g = 0; g < impl_->groups.size(); ++g) {
    if (impl_->groups[g].material != *material_at) continue;
    if (!query.batch_of || *query.batch_of == g)
      query.group[static_cast<Eigen::Index>(g)] =
          query.batch_of ? 1.0 : 1.0 / static_cast<double>(same_material);
  }
  if (own) {
    for (const Cell& cell : own->cells)
      if (query.batch_of == cell.group) found.own = cell.count;
  }
  Mixture sum;
  for (const GridPoint& point : impl_->points) {
    const double usual = point.s.machine * point.s.machine;
    const double outlier = own ? point.outlier[static_cast<std::size_t>(own - impl_->machines.data())]
                               : impl_->options.outlier_probability;
    // A new tool varies about the mean of the others, with a new batch.
    query.extra = query.batch_of
                      ? 0.0
                      : point.s.tool * point.s.tool * (1.0 + 1.0 / static_cast<double>(same_material)) +
                            point.s.batch * point.s.batch;
    addPrediction(own, point, query, usual, point.log_weight * (1.0 - outlier), &sum);
    addPrediction(own, point, query, usual + impl_->options.outlier_std * impl_->options.outlier_std,
                  point.log_weight * outlier, &sum);
  }
  found.log_std = std::sqrt(sum.variance());
  found.value = std::exp(sum.value());
  found.std_dev = found.value * found.log_std;
  return found;
}

namespace {

// Slope of a machine's residuals over time, weighted least squares about each group's mean.
void fitDrift(const std::vector<FleetObservation>& observations, const std::vector<std::size_t>& members,
              const std::vector<std::size_t>& group_of, double noise, MachineEffect* effect) {
  std::map<std::size_t, std::array<double, 3>> sums;  // weight, time, value
  const auto weightOf = [&](std::size_t i) {
    const FleetObservation& o = observations[i];
    const double own = std::isfinite(o.std_dev) ? o.std_dev / o.value : DEFAULT_STD;
    return 1.0 / std::max(own * own + noise * noise, LEAST_STD * LEAST_STD);
  };
  for (const std::size_t i : members) {
    std::array<double, 3>& s = sums[group_of[i]];
    s[0] += weightOf(i);
    s[1] += weightOf(i) * observations[i].stamp;
    s[2] += weightOf(i) * std::log(observations[i].value);
  }
  double tt = 0.0, ty = 0.0;
  for (const std::size_t i : members) {
    const std::array<double, 3>& s = sums[group_of[i]];
    const double t = observations[i].stamp - s[1] / s[0];
    tt += weightOf(i) * t * t;
    ty += weightOf(i) * t * (std::log(observations[i].value) - s[2] / s[0]);
  }
  effect->drift = tt > 0.0 ? ty / tt : 0.0;
  effect->drift_std = tt > 0.0 ? 1.0 / std::sqrt(tt) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

std::vector<MachineEffect> FleetModel::machines() const {
  std::vector<MachineEffect> found;
  EffectQuery query;
  query.group = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(impl_->groups.size()));
  for (std::size_t m = 0; m < impl_->machines.size(); ++m) {
    const Machine& machine = impl_->machines[m];
    MachineEffect effect;
    effect.machine = machine.name;
    effect.observations = static_cast<int>(machine.observations.size());
    Mixture sum;
    for (const GridPoint& point : impl_->points) {
      const double usual = point.s.machine * point.s.machine;
      effect.outlier += point.log_weight * point.outlier[m];
      addPrediction(&machine, point, query, usual, point.log_weight * (1.0 - point.outlier[m]), &sum);
      addPrediction(&machine, point, query, usual + impl_->options.outlier_std * impl_->options.outlier_std,
                    point.log_weight * point.outlier[m], &sum);
    }
    double weight = 0.0;
    for (const GridPoint& point : impl_->points) weight += point.log_weight;
    effect.outlier /= weight;
    effect.effect = sum.value();
    effect.std_dev = std::sqrt(sum.variance());
    fitDrift(impl_->observations, machine.observations, impl_->group_of, impl_->noise, &effect);
    found.push_back(effect);
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.machine < b.machine; });
  return found;
}

FleetDeviations FleetModel::deviations() const {
  FleetDeviations mean;
  double weight = 0.0;
  for (const GridPoint& point : impl_->points) {
    weight += point.log_weight;
    mean.machine += point.log_weight * point.s.machine;
    mean.batch += point.log_weight * point.s.batch;
    mean.tool += point.log_weight * point.s.tool;
  }
  return {mean.machine / weight, mean.batch / weight, mean.tool / weight, impl_->noise};
}

std::string MachineEffect::meaning() const {
  constexpr double SIGNIFICANT = 4.0;  // standard deviations
  if (std::isfinite(drift_std) && std::abs(drift) > SIGNIFICANT * drift_std)
    return "changes with time: spindle wear or drift of the load meter";
  return "constant in all cuts: wrong load-meter constant";
}

std::vector<FleetObservation> observationsOf(const std::vector<CoefficientRecord>& records,
                                             double CuttingCoefficients::*coefficient) {
  std::vector<FleetObservation> found;
  for (const CoefficientRecord& r : records) {
    const double value = r.set.value.*coefficient;
    if (value > 0.0 && std::isfinite(value))
      found.push_back(
          {r.machine, r.set.material, r.set.tool, value, r.set.std_dev.*coefficient, r.set.stamp});
  }
  return found;
}

}  // namespace smartmill::loadmeter
