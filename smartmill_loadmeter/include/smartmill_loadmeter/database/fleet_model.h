#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// One value of something that is above zero, seen by one machine: a coefficient, or the stiffness of a tool
/// in it.
struct FleetObservation {
  std::string machine, material, tool;
  double value = 0.0;    ///< > 0, any unit
  double std_dev = 0.0;  ///< of the value by itself; NaN: not known
  double stamp = 0.0;    ///< [s]
};

/// What machines share and what is each one's own, in logarithms:
///   log y = group + machine + batch + noise,
/// group (tool in material) about its material's mean with deviation `tool`, machine about 0 with deviation
/// `machine` (the bias of its load meter, its stiffness), batch of a machine's group with deviation `batch`,
/// noise of the stated deviation and `noise` beside. A machine is with a small probability an odd one, whose
/// effect may be `odd_size` wide.
struct FleetDeviations {
  double machine = 0.0, batch = 0.0, tool = 0.0, noise = 0.0;  ///< [1] of the logarithm
};

struct FleetModelOptions {
  double odd_share = 0.02;  ///< [1] 0..0.5, of machines, before anything is known of them
  double odd_size = 0.15;   ///< [1] > 0, deviation of an odd machine's effect beside the others'
  std::optional<FleetDeviations>
      known;  ///< the deviations; empty: from the observations, averaged over what they leave open
};

/// A value with its deviation, both as they are (not logarithms).
struct FleetPrediction {
  double value = 0.0, std_dev = 0.0;
  double log_std = 0.0;      ///< [1] of the logarithm
  int own = 0;               ///< observations by this machine of this group
  bool known_group = false;  ///< some machine cut this tool in this material
};

/// How a machine differs from its fleet.
struct MachineEffect {
  std::string machine;
  int observations = 0;
  double effect = 0.0, std_dev = 0.0;   ///< [1] of the logarithm: 0.05 is 5 % above the fleet
  double odd = 0.0;                     ///< [1] probability that it is none of the usual ones
  double drift = 0.0, drift_std = 0.0;  ///< [1/s] of the effect; std NaN: too few times to tell
  /// What an odd one points to: constant for all cuts (a wrong load-meter constant), or changing (a spindle
  /// that wears).
  std::string meaning() const;
};

/// Hierarchical model of a fleet. Machine and batch effects are best linear unbiased predictions given their
/// deviations (Henderson's mixed model), these are averaged over the restricted likelihood and wide
/// beliefs of each, odd machines are a second component of the machine's effect. O(observations + grid x
/// machines x groups^2).
class FleetModel {
 public:
  /// @throws Error without an observation above zero, or with one that is not.
  explicit FleetModel(const std::vector<FleetObservation>& observations,
                      const FleetModelOptions& options = FleetModelOptions());
  ~FleetModel();
  FleetModel(FleetModel&&) noexcept;

  /// What the next cut of this machine will show; machine and tool may be new. Empty: nobody cut this
  /// material.
  std::optional<FleetPrediction> predict(const std::string& machine, const std::string& material,
                                         const std::string& tool) const;
  std::vector<MachineEffect> machines() const;  ///< by name
  FleetDeviations deviations() const;           ///< means over what the observations leave open

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Observations of one coefficient in records that state it.
std::vector<FleetObservation> observationsOf(const std::vector<CoefficientRecord>& records,
                                             double CuttingCoefficients::*coefficient);

}  // namespace smartmill::loadmeter
