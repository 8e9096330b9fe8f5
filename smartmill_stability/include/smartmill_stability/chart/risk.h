#pragma once

#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_stability/chart/uncertainty.h"

namespace smartmill::stability {

/// What an estimate's own standard deviation does not know, as shares of the values: a spindle that turns and
/// warms up is not the one that was tapped at rest.
struct LeastDeviations {
  double frequency = 0.0;  ///< [1] >= 0
  double damping = 0.0;    ///< [1] >= 0
  double gain = 0.0;       ///< [1] >= 0
  double cutting = 0.0;    ///< [1] >= 0
  double radial = 0.0;     ///< [1] >= 0 of a radial coefficient that was taken from the tangential one
};

/// A measured machine with the deviations of its modes and coefficients; what has none gets a tenth.
/// @param system of systemModes(x, y)
UncertainSystem measuredSystem(const RegenerativeSystem& system, const ModalModel& x, const ModalModel& y,
                               const CoefficientSet& coefficients, const LeastDeviations& least = {});

/// Limits of the mean machine and of drawn ones, by the zero-order solution: their ratio says how far limits
/// spread, whatever solver made the chart. [m]
struct DrawnLimits {
  std::vector<double> mean;                ///< [speed]
  std::vector<std::vector<double>> drawn;  ///< [draw][speed]
};
DrawnLimits drawnLimits(const UncertainSystem& system, const std::vector<double>& speeds, int draws,
                        unsigned seed);

/// [1] of the mean machine's limit at each speed: a cut so deep chatters on at most a share `risk` of the
/// drawn machines, at any speed within the margin. @param speeds [rad/s] rising @param speed_margin [1]
std::vector<double> depthsAtRisk(const DrawnLimits& limits, const std::vector<double>& speeds, double risk,
                                 double speed_margin);

/// How sure a cut is to be stable.
struct RiskOptions {
  double risk = 0.05;          ///< [1] largest probability of chatter
  double speed_margin = 0.01;  ///< [1] the speed may be so much off
  int draws = 40;              ///< >= 1
  unsigned seed = 1;
};

/// Machines drawn from what is known of one, asked by collocation; each is made when it is first asked for.
/// The mean machine is asked first, as it costs least.
class DrawnMachines {
 public:
  DrawnMachines(const UncertainSystem& system, const RiskOptions& options);
  ~DrawnMachines();

  /// [1] Share of them that chatters in a cut at a speed [rad/s] or the margin of speed beside it; nothing as
  /// soon as it is above the risk. @param depth [m]
  std::optional<double> probability(double speed, double depth);
  /// Whether the mean machine is stable in the cut at all these speeds.
  bool meanBears(double speed, double depth) const;

 private:
  const UncertainSystem& system_;
  RiskOptions options_;
  std::mt19937_64 random_;
  std::unique_ptr<FloquetSolver> mean_;
  std::vector<std::unique_ptr<FloquetSolver>> drawn_;
};

struct StableSpeed {
  double speed = 0.0;        ///< [rad/s]
  double probability = 0.0;  ///< [1] of chatter there, the margin of speed included
  double below = 0.0,
         above = 0.0;  ///< [rad/s] the mean machine is stable from here to there, as far as asked
};

/// The fastest speed within low..high [rad/s] at which a cut of a depth [m] chatters with at most the risk;
/// none where there is no such speed. At constant feed per tooth the fastest removes most.
std::optional<StableSpeed> stableSpeed(const UncertainSystem& system, double depth, double low, double high,
                                       const RiskOptions& options = {});

}  // namespace smartmill::stability
