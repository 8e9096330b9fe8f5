#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// Positive quantity observed by one machine: a coefficient, or the stiffness of a tool in it.
struct FleetObservation {
  std::string machine, material, tool;
  double value = 0.0;    ///< > 0, any unit
  double std_dev = 0.0;  ///< of the value; NaN: unknown
  double stamp = 0.0;    ///< [s]
};

/// Standard deviations of the hierarchical model of logarithms
///   log y = group + machine + batch + noise,
/// where group (tool in material) varies about its material's mean by `tool`, machine (bias of its load
/// meter, its stiffness) by `machine`, batch (of a machine's group) by `batch`, and noise is the stated
/// deviation and `noise`. With a small probability a machine is an outlier, whose effect has the additional
/// standard deviation `outlier_std`.
struct FleetDeviations {
  double machine = 0.0, batch = 0.0, tool = 0.0, noise = 0.0;  ///< [1] of the logarithm
};

struct FleetModelOptions {
  double outlier_probability = 0.02;     ///< [1] 0..0.5, prior probability that a machine is an outlier
  double outlier_std = 0.15;             ///< [1] > 0, additional standard deviation of an outlier's effect
  std::optional<FleetDeviations> known;  ///< deviations; empty: averaged over their posterior
  double unstated_std = 0.05;            ///< [1] relative standard deviation of an observation without one
  /// Scales of the half-normal priors of the deviations [1], wide; they matter with two or three machines.
  FleetDeviations prior{0.15, 0.1, 0.3, 0.0};

  /// Grid over machine, batch and tool that integrates the posterior.
  struct Grid {
    /// [1] ranges, logarithmic: from negligible deviations to more than three scales of the priors.
    FleetDeviations low{2e-3, 5e-4, 3e-3, 0.0}, high{0.5, 0.3, 1.0, 0.0};
    int coarse = 8, fine = 7;       ///< points of each axis of the first and the second grid
    double spread = 2.0;            ///< [1] standard deviations that the second grid extends on each side
    double smallest_weight = 1e-4;  ///< [1] points with a smaller weight are removed
  } grid;
};

/// Value and standard deviation (not logarithms).
struct FleetPrediction {
  double value = 0.0, std_dev = 0.0;
  double log_std = 0.0;  ///< [1] of the logarithm
  int own = 0;           ///< observations by this machine of this group
};

/// Deviation of a machine from its fleet.
struct MachineEffect {
  std::string machine;
  int observations = 0;
  double effect = 0.0, std_dev = 0.0;   ///< [1] of the logarithm: 0.05 is 5 % above the fleet
  double outlier = 0.0;                 ///< [1] probability that it is an outlier
  double drift = 0.0, drift_std = 0.0;  ///< [1/s] of the effect; std NaN: too few times
  /// Probable cause of an outlier: constant in all cuts (a wrong load-meter constant), or changing (spindle
  /// wear).
  std::string meaning() const;
};

/// Hierarchical model of a fleet. Machine and batch effects are best linear unbiased predictions given the
/// deviations (Henderson's mixed model), averaged over the restricted likelihood and a wide prior of the
/// deviations; outliers are a second component of the machine's effect. O(observations + grid x machines x
/// groups^2).
class FleetModel {
 public:
  /// @throws Error without observations or with one that is not positive.
  explicit FleetModel(const std::vector<FleetObservation>& observations,
                      const FleetModelOptions& options = FleetModelOptions());
  ~FleetModel();
  FleetModel(FleetModel&&) noexcept;

  /// Prediction of the next cut of a machine; machine and tool may be new. Empty: no observation in this
  /// material.
  std::optional<FleetPrediction> predict(const std::string& machine, const std::string& material,
                                         const std::string& tool) const;
  std::vector<MachineEffect> machines() const;  ///< by name
  FleetDeviations deviations() const;           ///< posterior means

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Observations of one coefficient in records that state it.
std::vector<FleetObservation> observationsOf(const std::vector<CoefficientRecord>& records,
                                             double CuttingCoefficients::*coefficient);

}  // namespace smartmill::loadmeter
