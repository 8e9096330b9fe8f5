#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "fleet_layout.h"

namespace smartmill::loadmeter {

/// Solution at one point of the deviations: weight, groups' effects, and outlier probability of each machine.
struct FleetPoint {
  FleetDeviations s;
  double log_weight = 0.0;
  Eigen::VectorXd groups;
  Eigen::MatrixXd covariance;
  std::vector<double> outlier;
};

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

/// Combination of effects to predict: the machine's effect, groups, and a batch of a group.
struct EffectQuery {
  Eigen::VectorXd group;                // weights of the groups' effects
  double extra = 0.0;                   // [1] variance of unobserved effects
  std::optional<std::size_t> batch_of;  // group whose batch effect is included
};

/// Mixed model of a fleet at given deviations (Henderson).
class FleetSolver {
 public:
  FleetSolver(const std::vector<FleetObservation>& observations, const FleetModelOptions& options);

  const FleetLayout& layout() const { return layout_; }
  FleetPoint solve(const FleetDeviations& s) const;
  /// Adds the best linear unbiased prediction at a point to a mixture, for a usual machine and an outlier.
  /// @param machine nullptr: a new one
  void predict(const MachineCells* machine, const FleetPoint& point, const EffectQuery& query,
               Mixture* sum) const;

 private:
  double outlierVariance(double usual) const;
  Eigen::VectorXd residualOf(const MachineCells& machine, const Eigen::VectorXd& effects) const;
  Eigen::MatrixXd toolPrior(double tool) const;
  void solveGroups(FleetPoint* point) const;
  void addComponent(const MachineCells* machine, const FleetPoint& point, const EffectQuery& query,
                    double effect_variance, double share, Mixture* sum) const;

  FleetModelOptions options_;
  FleetLayout layout_;
};

}  // namespace smartmill::loadmeter
