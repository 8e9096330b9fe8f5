#pragma once

#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/chart/uncertainty.h"

namespace smartmill::stability {

/// Standard deviations added to those of the estimates, relative to the values: dynamics measured at rest
/// differ from those of a rotating, warm spindle.
struct LeastDeviations {
  double frequency = 0.0;  ///< [1] >= 0
  double damping = 0.0;    ///< [1] >= 0
  double gain = 0.0;       ///< [1] >= 0
  double cutting = 0.0;    ///< [1] >= 0
  double radial = 0.0;     ///< [1] >= 0, of a radial coefficient derived from the tangential one
};

/// A measured machine with the standard deviations of its modes and coefficients; a value without one gets 10
/// %.
/// @param system with the modes of systemModes(x, y), then those of the workpiece
UncertainSystem measuredSystem(const RegenerativeSystem& system, const ModalModel& x, const ModalModel& y,
                               const WorkpieceModes& workpiece, const CoefficientSet& coefficients,
                               const LeastDeviations& least = {});

/// [m] Limits of the mean machine and of drawn machines by the zero-order solution. Their ratio is the spread
/// of the limits, also for charts of other solvers.
struct DrawnLimits {
  std::vector<double> mean;                ///< [speed]
  std::vector<std::vector<double>> drawn;  ///< [draw][speed]
};
DrawnLimits drawnLimits(const UncertainSystem& system, const std::vector<double>& speeds, int draws,
                        unsigned seed);

/// [1] Depth at each speed, relative to the limit of the mean machine, that chatters on at most the fraction
/// `risk` of the drawn machines at any speed within the margin.
/// @param speeds [rad/s] ascending @param speed_margin [1]
std::vector<double> depthsAtRisk(const DrawnLimits& limits, const std::vector<double>& speeds, double risk,
                                 double speed_margin);

/// Accepted risk of a cut.
struct RiskOptions {
  double risk = 0.05;          ///< [1] largest probability of chatter
  double speed_margin = 0.01;  ///< [1] relative error of the speed on both sides
  int draws = 40;              ///< >= 1
  unsigned seed = 1;
};

/// Machines drawn from an uncertain system and solved by collocation; each solver is created on first use.
class DrawnMachines {
 public:
  DrawnMachines(const UncertainSystem& system, const RiskOptions& options);
  ~DrawnMachines();

  /// [1] Fraction of the machines that chatter in a cut at a speed [rad/s] or at either end of its margin;
  /// empty when it exceeds the risk. @param depth [m]
  std::optional<double> probability(double speed, double depth);
  /// Whether the mean machine is stable at all three speeds.
  bool meanIsStable(double speed, double depth) const;

 private:
  const UncertainSystem& system_;
  RiskOptions options_;
  std::mt19937_64 random_;
  std::unique_ptr<FloquetSolver> mean_;
  std::vector<std::unique_ptr<FloquetSolver>> drawn_;
};

struct StableSpeed {
  double speed = 0.0;        ///< [rad/s]
  double probability = 0.0;  ///< [1] of chatter within the speed margin
  /// [rad/s] Range around the speed in which the mean machine is stable, limited to the searched range.
  double below = 0.0, above = 0.0;
};

/// The highest speed within low..high [rad/s] at which a cut of a depth [m] chatters with at most the
/// accepted risk; empty without such a speed. At constant feed per tooth the highest speed removes most.
/// @throws Error on a depth or a range that is not positive.
std::optional<StableSpeed> stableSpeed(const UncertainSystem& system, double depth, double low, double high,
                                       const RiskOptions& options = {});

}  // namespace smartmill::stability
