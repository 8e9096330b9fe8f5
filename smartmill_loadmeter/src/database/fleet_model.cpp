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

constexpr double UNSTATED = 0.05;  // [1] deviation of an observation that states none
// [1] half-normal beliefs of the deviations; they count where two or three machines tell little.
constexpr FleetDeviations BELIEVED{0.15, 0.1, 0.3, 0.0};
constexpr double CERTAIN = 1e-9;  // [1] least deviation of a cell

/// All of one machine's observations of one group.
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

/// The marginal covariance of a machine's cells, D + s^2 11', by Woodbury.
struct Block {
  Eigen::VectorXd weight;  // of D's inverse
  double shrink = 0.0;     // V^-1 = W - shrink w w'
  double log_determinant = 0.0;

  Block(const Machine& machine, double effect_variance, double batch_variance)
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

/// One choice of deviations: its weight, the groups' effects, and how odd each machine is.
struct Node {
  FleetDeviations s;
  double log_weight = 0.0;
  Eigen::VectorXd groups;
  Eigen::MatrixXd covariance;
  std::vector<double> odd;
};

double gauss(const Block& block, const Eigen::VectorXd& r) {
  return -0.5 * (block.log_determinant + r.dot(block.solve(r)));
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
  std::vector<Node> nodes;

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
    const double relative = std::isfinite(o.std_dev) ? o.std_dev / o.value : UNSTATED;
    return relative * relative;
  }

  void sort();
  void estimateNoise();
  void fillCells();
  Eigen::VectorXd rest(const Machine& machine, const Eigen::VectorXd& effects) const;
  Eigen::MatrixXd toolPrior(double tool) const;
  void solveGroups(Node* node) const;
  Node solve(const FleetDeviations& s) const;
  void explore();
  void average(const std::array<std::vector<double>, 3>& axes, bool last);
};

void FleetModel::Impl::sort() {
  for (const FleetObservation& o : observations) {
    if (!(o.value > 0.0) || !std::isfinite(o.value))
      throw Error("fleet: a value of '" + o.machine + "' in '" + o.material + "' is not above 0");
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
  if (observations.empty()) throw Error("fleet: nothing was observed");
}

// Scatter within cells beyond the stated deviations, by moments: E sum (y - mean)^2 = sum (1 - 1/n) (s^2 +
// noise^2).
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
      const double variance = std::max(ownVariance(observations[i]) + noise * noise, CERTAIN * CERTAIN);
      // For now: sums of weights and of weighted values.
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

Eigen::VectorXd FleetModel::Impl::rest(const Machine& machine, const Eigen::VectorXd& effects) const {
  Eigen::VectorXd r(machine.cells.size());
  for (std::size_t i = 0; i < machine.cells.size(); ++i)
    r[static_cast<Eigen::Index>(i)] =
        machine.cells[i].mean - effects[static_cast<Eigen::Index>(machine.cells[i].group)];
  return r;
}

// Precision of the groups about their material's unknown mean: (I - 11'/n) / tool^2 for each material.
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

// Generalised least squares of the groups' effects, each machine's block between usual and odd by how odd it
// is.
void FleetModel::Impl::solveGroups(Node* node) const {
  const double usual = node->s.machine * node->s.machine, batch = node->s.batch * node->s.batch;
  const double wide = usual + options.odd_size * options.odd_size;
  const auto count = static_cast<Eigen::Index>(groups.size());
  Eigen::MatrixXd normal = toolPrior(node->s.tool);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (std::size_t m = 0; m < machines.size(); ++m) {
    const std::vector<Cell>& cells = machines[m].cells;
    for (const auto& [share, variance] :
         {std::pair{1.0 - node->odd[m], usual}, std::pair{node->odd[m], wide}}) {
      if (share == 0.0) continue;
      const Block block(machines[m], variance, batch);
      double mean = 0.0;
      for (std::size_t i = 0; i < cells.size(); ++i)
        mean += block.weight[static_cast<Eigen::Index>(i)] * cells[i].mean;
      for (std::size_t i = 0; i < cells.size(); ++i) {
        const double w = block.weight[static_cast<Eigen::Index>(i)];
        const auto g = static_cast<Eigen::Index>(cells[i].group);
        right[g] += share * w * (cells[i].mean - block.shrink * mean);
        normal(g, g) += share * w;
        for (std::size_t j = 0; j < cells.size(); ++j)
          normal(g, static_cast<Eigen::Index>(cells[j].group)) -=
              share * block.shrink * w * block.weight[static_cast<Eigen::Index>(j)];
      }
    }
  }
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  node->groups = solver.solve(right);
  node->covariance = solver.solve(Eigen::MatrixXd::Identity(count, count));
  node->log_weight = -0.5 * solver.vectorD().array().abs().max(1e-300).log().sum();
}

// Groups and oddness in turn; then the restricted likelihood of these deviations.
Node FleetModel::Impl::solve(const FleetDeviations& s) const {
  constexpr int TURNS = 12;
  constexpr double SETTLED = 1e-4;
  Node node;
  node.s = s;
  node.odd.assign(machines.size(), 0.0);
  const double batch = s.batch * s.batch, usual = s.machine * s.machine;
  const double wide = usual + options.odd_size * options.odd_size;
  double likelihood = 0.0;
  for (int turn = 0; turn < TURNS; ++turn) {
    solveGroups(&node);
    double change = 0.0;
    likelihood = 0.0;
    for (std::size_t m = 0; m < machines.size(); ++m) {
      const Eigen::VectorXd r = rest(machines[m], node.groups);
      const double as_usual = std::log1p(-options.odd_share) + gauss(Block(machines[m], usual, batch), r);
      const double as_odd = options.odd_share > 0.0
                                ? std::log(options.odd_share) + gauss(Block(machines[m], wide, batch), r)
                                : -std::numeric_limits<double>::infinity();
      const double top = std::max(as_usual, as_odd);
      const double sum = std::exp(as_usual - top) + std::exp(as_odd - top);
      likelihood += top + std::log(sum);
      const double odd = std::exp(as_odd - top) / sum;
      change = std::max(change, std::abs(odd - node.odd[m]));
      node.odd[m] = odd;
    }
    if (change < SETTLED) break;
  }
  const double contrasts = static_cast<double>(groups.size() - materials.size());
  node.log_weight +=
      likelihood - contrasts * std::log(s.tool) - 0.5 * node.groups.dot(toolPrior(s.tool) * node.groups);
  return node;
}

void FleetModel::Impl::average(const std::array<std::vector<double>, 3>& axes, bool last) {
  nodes.clear();
  for (const double machine : axes[0]) {
    for (const double batch : axes[1]) {
      for (const double tool : axes[2]) {
        nodes.push_back(solve({machine, batch, tool, noise}));
        // The axes are logarithmic.
        nodes.back().log_weight +=
            std::log(machine * batch * tool) -
            0.5 * (std::pow(machine / BELIEVED.machine, 2) + std::pow(batch / BELIEVED.batch, 2) +
                   std::pow(tool / BELIEVED.tool, 2));
      }
    }
  }
  double top = -std::numeric_limits<double>::infinity(), sum = 0.0;
  for (const Node& node : nodes) top = std::max(top, node.log_weight);
  for (Node& node : nodes) sum += node.log_weight = std::exp(node.log_weight - top);
  for (Node& node : nodes) node.log_weight /= sum;
  if (!last) return;
  constexpr double SMALL = 1e-4;  // of the weight: left out
  nodes.erase(std::remove_if(nodes.begin(), nodes.end(), [](const Node& n) { return n.log_weight < SMALL; }),
              nodes.end());
}

// Twice over a grid: wide, then where the weight was. From here on log_weight is the weight itself.
void FleetModel::Impl::explore() {
  if (options.known) {
    nodes = {solve(*options.known)};
    nodes[0].log_weight = 1.0;
    return;
  }
  const std::array<std::pair<double, double>, 3> wide{{{2e-3, 0.5}, {5e-4, 0.3}, {3e-3, 1.0}}};
  constexpr int COARSE = 8, FINE = 7;
  std::array<std::vector<double>, 3> axes;
  for (std::size_t a = 0; a < 3; ++a) {
    for (int i = 0; i < COARSE; ++i)
      axes[a].push_back(wide[a].first * std::pow(wide[a].second / wide[a].first, i / (COARSE - 1.0)));
  }
  average(axes, false);
  const std::array<double FleetDeviations::*, 3> members{&FleetDeviations::machine, &FleetDeviations::batch,
                                                         &FleetDeviations::tool};
  for (std::size_t a = 0; a < 3; ++a) {
    double mean = 0.0, square = 0.0;
    for (const Node& node : nodes) {
      const double x = std::log(node.s.*members[a]);
      mean += node.log_weight * x;
      square += node.log_weight * x * x;
    }
    const double step = std::log(wide[a].second / wide[a].first) / (COARSE - 1.0);
    const double spread = std::max(0.5 * step, std::sqrt(std::max(0.0, square - mean * mean)));
    axes[a].clear();
    for (int i = 0; i < FINE; ++i)
      axes[a].push_back(std::exp(mean + spread * (4.0 * i / (FINE - 1.0) - 2.0)));
  }
  average(axes, true);
}

FleetModel::FleetModel(const std::vector<FleetObservation>& observations, const FleetModelOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  impl_->observations = observations;
  impl_->sort();
  impl_->estimateNoise();
  impl_->fillCells();
  impl_->explore();
}
FleetModel::~FleetModel() = default;
FleetModel::FleetModel(FleetModel&&) noexcept = default;

namespace {

/// A mixture of normals, by its first two moments.
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

/// What is asked of the random effects of a machine: its own effect, and a batch of a group where it has one.
struct Asked {
  Eigen::VectorXd group;                // weights of the groups' effects
  double extra = 0.0;                   // [1] variance of what no observation shows
  double machine = 1.0;                 // share of the machine's effect
  std::optional<std::size_t> batch_of;  // group whose batch effect counts
};

/// Best linear unbiased prediction for one component of the machine's effect (Henderson).
void addPrediction(const Machine* machine, const Node& node, const Asked& asked, double effect_variance,
                   double share, Mixture* sum) {
  const double batch = node.s.batch * node.s.batch;
  double mean = asked.group.dot(node.groups);
  double variance = asked.extra + asked.machine * effect_variance + (asked.batch_of ? batch : 0.0);
  Eigen::VectorXd group = asked.group;
  if (machine) {
    const Block block(*machine, effect_variance, batch);
    Eigen::VectorXd towards(machine->cells.size()), rest(machine->cells.size());
    for (std::size_t i = 0; i < machine->cells.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      towards[at] =
          asked.machine * effect_variance + (asked.batch_of == machine->cells[i].group ? batch : 0.0);
      rest[at] = machine->cells[i].mean - node.groups[static_cast<Eigen::Index>(machine->cells[i].group)];
    }
    const Eigen::VectorXd gain = block.solve(towards);
    mean += gain.dot(rest);
    variance -= gain.dot(towards);
    for (std::size_t i = 0; i < machine->cells.size(); ++i)
      group[static_cast<Eigen::Index>(machine->cells[i].group)] -= gain[static_cast<Eigen::Index>(i)];
  }
  sum->add(share, mean, variance + group.dot(node.covariance * group));
}

}  // namespace

std::optional<FleetPrediction> FleetModel::predict(const std::string& machine, const std::string& material,
                                                   const std::string& tool) const {
  const auto material_at = impl_->materialAt(material);
  if (!material_at) return std::nullopt;
  const Machine* own = impl_->machineAt(machine);
  const auto count = static_cast<Eigen::Index>(impl_->groups.size());
  Asked asked;
  asked.group = Eigen::VectorXd::Zero(count);
  FleetPrediction found;
  std::size_t same_material = 0;
  for (std::size_t g = 0; g < impl_->groups.size(); ++g) {
    if (impl_->groups[g].material != *material_at) continue;
    ++same_material;
    if (impl_->groups[g].tool == tool) asked.batch_of = g;
  }
  found.known_group = asked.batch_of.has_value();
  for (std::size_t g = 0; g < impl_->groups.size(); ++g) {
    if (impl_->groups[g].material != *material_at) continue;
    if (!asked.batch_of || *asked.batch_of == g)
      asked.group[static_cast<Eigen::Index>(g)] =
          asked.batch_of ? 1.0 : 1.0 / static_cast<double>(same_material);
  }
  if (own) {
    for (const Cell& cell : own->cells)
      if (asked.batch_of == cell.group) found.own = cell.count;
  }
  Mixture sum;
  for (const Node& node : impl_->nodes) {
    const double usual = node.s.machine * node.s.machine;
    const double odd =
        own ? node.odd[static_cast<std::size_t>(own - impl_->machines.data())] : impl_->options.odd_share;
    // A tool that nobody tried lies about the others' mean; its batch is as any.
    asked.extra = asked.batch_of
                      ? 0.0
                      : node.s.tool * node.s.tool * (1.0 + 1.0 / static_cast<double>(same_material)) +
                            node.s.batch * node.s.batch;
    addPrediction(own, node, asked, usual, node.log_weight * (1.0 - odd), &sum);
    addPrediction(own, node, asked, usual + impl_->options.odd_size * impl_->options.odd_size,
                  node.log_weight * odd, &sum);
  }
  found.log_std = std::sqrt(sum.variance());
  found.value = std::exp(sum.value());
  found.std_dev = found.value * found.log_std;
  return found;
}

namespace {

// Slope over time of what a machine's cells leave, weighted least squares about each group's mean.
void fitDrift(const std::vector<FleetObservation>& observations, const std::vector<std::size_t>& members,
              const std::vector<std::size_t>& group_of, double noise, MachineEffect* effect) {
  std::map<std::size_t, std::array<double, 3>> sums;  // weight, time, value
  const auto weightOf = [&](std::size_t i) {
    const FleetObservation& o = observations[i];
    const double own = std::isfinite(o.std_dev) ? o.std_dev / o.value : UNSTATED;
    return 1.0 / std::max(own * own + noise * noise, CERTAIN * CERTAIN);
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
  Asked asked;
  asked.group = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(impl_->groups.size()));
  for (std::size_t m = 0; m < impl_->machines.size(); ++m) {
    const Machine& machine = impl_->machines[m];
    MachineEffect effect;
    effect.machine = machine.name;
    effect.observations = static_cast<int>(machine.observations.size());
    Mixture sum;
    for (const Node& node : impl_->nodes) {
      const double usual = node.s.machine * node.s.machine;
      effect.odd += node.log_weight * node.odd[m];
      addPrediction(&machine, node, asked, usual, node.log_weight * (1.0 - node.odd[m]), &sum);
      addPrediction(&machine, node, asked, usual + impl_->options.odd_size * impl_->options.odd_size,
                    node.log_weight * node.odd[m], &sum);
    }
    double weight = 0.0;
    for (const Node& node : impl_->nodes) weight += node.log_weight;
    effect.odd /= weight;
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
  for (const Node& node : impl_->nodes) {
    weight += node.log_weight;
    mean.machine += node.log_weight * node.s.machine;
    mean.batch += node.log_weight * node.s.batch;
    mean.tool += node.log_weight * node.s.tool;
  }
  return {mean.machine / weight, mean.batch / weight, mean.tool / weight, impl_->noise};
}

std::string MachineEffect::meaning() const {
  constexpr double SURE = 4.0;  // deviations
  if (std::isfinite(drift_std) && std::abs(drift) > SURE * drift_std)
    return "changes with time: a spindle that wears, or a load meter that drifts";
  return "the same in all cuts: a wrong load-meter constant";
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
