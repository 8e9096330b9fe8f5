#include "smartmill_loadmeter/database/fleet_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Core>

#include "fleet_posterior.h"
#include "fleet_solver.h"

namespace smartmill::loadmeter {

struct FleetModel::Impl {
  FleetSolver solver;
  std::vector<FleetPoint> points;

  Impl(const std::vector<FleetObservation>& observations, const FleetModelOptions& options)
      : solver(observations, options), points(posteriorOf(solver, options)) {}
};

FleetModel::FleetModel(const std::vector<FleetObservation>& observations, const FleetModelOptions& options)
    : impl_(std::make_unique<Impl>(observations, options)) {
}
FleetModel::~FleetModel() = default;
FleetModel::FleetModel(FleetModel&&) noexcept = default;

std::optional<FleetPrediction> FleetModel::predict(const std::string& machine, const std::string& material,
                                                   const std::string& tool) const {
  const FleetLayout& layout = impl_->solver.layout();
  const auto material_at = layout.materialAt(material);
  if (!material_at) return std::nullopt;
  const MachineCells* own = layout.machineAt(machine);
  const auto count = static_cast<Eigen::Index>(layout.groups.size());
  EffectQuery query;
  query.group = Eigen::VectorXd::Zero(count);
  FleetPrediction found;
  std::size_t same_material = 0;
  for (std::size_t g = 0; g < layout.groups.size(); ++g) {
    if (layout.groups[g].material != *material_at) continue;
    ++same_material;
    if (layout.groups[g].tool == tool) query.batch_of = g;
  }
  for (std::size_t g = 0; g < layout.groups.size(); ++g) {
    if (layout.groups[g].material != *material_at) continue;
    if (!query.batch_of || *query.batch_of == g)
      query.group[static_cast<Eigen::Index>(g)] =
          query.batch_of ? 1.0 : 1.0 / static_cast<double>(same_material);
  }
  if (own) {
    for (const FleetCell& cell : own->cells)
      if (query.batch_of == cell.group) found.own = cell.count;
  }
  Mixture sum;
  for (const FleetPoint& point : impl_->points) {
    // A new tool varies about the mean of the others, with a new batch.
    query.extra = query.batch_of
                      ? 0.0
                      : point.s.tool * point.s.tool * (1.0 + 1.0 / static_cast<double>(same_material)) +
                            point.s.batch * point.s.batch;
    impl_->solver.predict(own, point, query, &sum);
  }
  found.log_std = std::sqrt(sum.variance());
  found.value = std::exp(sum.value());
  found.std_dev = found.value * found.log_std;
  return found;
}

namespace {

// Slope of a machine's residuals over time, weighted least squares about each group's mean.
void fitDrift(const FleetLayout& layout, const MachineCells& machine, MachineEffect* effect) {
  std::map<std::size_t, std::array<double, 3>> sums;  // weight, time, value
  const auto weightOf = [&](std::size_t i) { return 1.0 / layout.varianceOf(layout.observations[i]); };
  for (const std::size_t i : machine.observations) {
    std::array<double, 3>& s = sums[layout.group_of[i]];
    s[0] += weightOf(i);
    s[1] += weightOf(i) * layout.observations[i].stamp;
    s[2] += weightOf(i) * std::log(layout.observations[i].value);
  }
  double tt = 0.0, ty = 0.0;
  for (const std::size_t i : machine.observations) {
    const std::array<double, 3>& s = sums[layout.group_of[i]];
    const double t = layout.observations[i].stamp - s[1] / s[0];
    tt += weightOf(i) * t * t;
    ty += weightOf(i) * t * (std::log(layout.observations[i].value) - s[2] / s[0]);
  }
  effect->drift = tt > 0.0 ? ty / tt : 0.0;
  effect->drift_std = tt > 0.0 ? 1.0 / std::sqrt(tt) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

std::vector<MachineEffect> FleetModel::machines() const {
  std::vector<MachineEffect> found;
  const FleetLayout& layout = impl_->solver.layout();
  EffectQuery query;
  query.group = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.groups.size()));
  for (std::size_t m = 0; m < layout.machines.size(); ++m) {
    const MachineCells& machine = layout.machines[m];
    MachineEffect effect;
    effect.machine = machine.name;
    effect.observations = static_cast<int>(machine.observations.size());
    Mixture sum;
    double weight = 0.0;
    for (const FleetPoint& point : impl_->points) {
      effect.outlier += point.log_weight * point.outlier[m];
      weight += point.log_weight;
      impl_->solver.predict(&machine, point, query, &sum);
    }
    effect.outlier /= weight;
    effect.effect = sum.value();
    effect.std_dev = std::sqrt(sum.variance());
    fitDrift(layout, machine, &effect);
    found.push_back(effect);
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.machine < b.machine; });
  return found;
}

FleetDeviations FleetModel::deviations() const {
  FleetDeviations mean;
  double weight = 0.0;
  for (const FleetPoint& point : impl_->points) {
    weight += point.log_weight;
    mean.machine += point.log_weight * point.s.machine;
    mean.batch += point.log_weight * point.s.batch;
    mean.tool += point.log_weight * point.s.tool;
  }
  return {mean.machine / weight, mean.batch / weight, mean.tool / weight, impl_->solver.layout().noise};
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
