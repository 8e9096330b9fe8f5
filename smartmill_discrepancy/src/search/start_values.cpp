#include "smartmill_discrepancy/search/start_values.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_sim/effects/effect_set.h"

namespace smartmill::discrepancy {

using Eigen::Index;

std::optional<std::vector<double>> equivalentValues(const Fitter& fitter, const Member& member,
                                                    const Hypothesis& hypothesis) {
  const auto radii = [&](const EffectEntry& entry) {
    MachineModel model = fitter.runner().data().nominal;
    model.effects = {entry};
    const std::vector<double> offset = sim::setUpOf(model, sim::EffectSet(model)).radius_offset;
    return Eigen::VectorXd(
        Eigen::Map<const Eigen::VectorXd>(offset.data(), static_cast<Index>(offset.size())));
  };
  std::vector<double> values;
  for (const Coordinate& c : hypothesis.coordinates) values.push_back(c.null);
  const Eigen::VectorXd null = radii(hypothesis.entry(values));
  const Eigen::VectorXd target = radii(member.hypothesis->entry(member.values)) - null;
  if (target.size() == 0 || target.isZero(0.0)) return {};
  Eigen::MatrixXd columns(null.size(), static_cast<Index>(values.size()));
  for (std::size_t c = 0; c < values.size(); ++c) {
    std::vector<double> moved = values;
    moved[c] += hypothesis.coordinates[c].step;
    columns.col(static_cast<Index>(c)) =
        (radii(hypothesis.entry(moved)) - null) / hypothesis.coordinates[c].step;
  }
  if (columns.size() == 0 || (columns.colwise().squaredNorm().array() == 0.0).any()) return {};
  const Eigen::VectorXd found = linear::leastNorm(columns, target);
  for (std::size_t c = 0; c < values.size(); ++c)
    values[c] = std::clamp(values[c] + found[static_cast<Index>(c)], hypothesis.coordinates[c].low,
                           hypothesis.coordinates[c].high);
  return values;
}

std::vector<double> bestStart(const Fitter& fitter, const FitResult& now, const PredictedGain& predicted,
                              const std::optional<std::vector<double>>& other) {
  if (predicted.null.empty() && !other) return predicted.start;
  std::vector<std::vector<double>> starts{predicted.start};
  for (const double share : {0.5, 0.2, 0.05}) {
    if (predicted.null.empty()) break;
    std::vector<double> start = predicted.null;
    for (std::size_t c = 0; c < start.size(); ++c)
      start[c] += share * (predicted.start[c] - predicted.null[c]);
    starts.push_back(std::move(start));
  }
  if (other) starts.push_back(*other);
  std::vector<MachineModel> models;
  for (const std::vector<double>& start : starts) {
    FitState with = now.state;
    with.members.push_back({predicted.hypothesis, start});
    models.push_back(fitter.model(with));
  }
  const auto simulated = simulateAll(fitter.runner(), models);
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < simulated.size(); ++k) {
    const double squares = residualSquares(fitter.runner(), simulated[k]);
    if (squares < least) {
      least = squares;
      best = k;
    }
  }
  return starts[best];
}

}  // namespace smartmill::discrepancy
