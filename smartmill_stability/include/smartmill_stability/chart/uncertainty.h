#pragma once

#include <functional>
#include <random>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Standard deviations of a mode, as shares of its values.
struct ModeUncertainty {
  double frequency = 0.0;  ///< [1] >= 0
  double damping = 0.0;    ///< [1] >= 0
  double gain = 0.0;       ///< [1] >= 0, of the compliance
};

/// A system known with standard deviations: a distribution of systems. Frequencies are normal, positive
/// quantities (damping, compliance, coefficients) log-normal with the standard deviation given; all
/// independent.
class UncertainSystem {
 public:
  /// @param modes one a mode of the system. @param kt_share, kr_share [1] standard deviations over the
  /// values.
  /// @throws Error on a wrong count or a negative share.
  UncertainSystem(const RegenerativeSystem& system, std::vector<ModeUncertainty> modes, double kt_share,
                  double kr_share);

  /// Tool tip and cutting coefficients of a model with their standard deviations, where it lacks them the
  /// percents of its section uncertainty_percent. @param system built from the same model: systemModes(x, y)
  static UncertainSystem of(const MachineModel& model, const RegenerativeSystem& system);

  /// The same deviations about another system of as many modes.
  UncertainSystem about(const RegenerativeSystem& system) const {
    return {system, modes_, kt_share_, kr_share_};
  }

  RegenerativeSystem draw(std::mt19937_64& random) const;
  const RegenerativeSystem& mean() const { return system_; }

 private:
  RegenerativeSystem system_;
  std::vector<ModeUncertainty> modes_;
  double kt_share_, kr_share_;
};

/// Share of drawn systems that are unstable at a speed [rad/s] and depth [m]. @param draws >= 1
double chatterProbability(const UncertainSystem& system, double speed, double depth, int draws, unsigned seed,
                          Method method = Method::collocation);

/// Probability of chatter over speeds and depths.
struct ProbabilityChart {
  std::vector<double> speeds;  ///< [rad/s]
  std::vector<double> depths;  ///< [m] rising
  std::vector<std::vector<double>>
      probability;              ///< [speed][depth] share of draws whose first limit lies below
  std::vector<double> nominal;  ///< [m] limit of the mean system
};

/// @param progress called with the share done. @throws Error on empty axes.
ProbabilityChart probabilityChart(const UncertainSystem& system, const std::vector<double>& speeds,
                                  const std::vector<double>& depths, int draws, unsigned seed,
                                  const std::function<void(double)>& progress = {});

/// A cut whose probability of chatter stays below a risk, also for speeds a margin off.
struct RobustPoint {
  double speed = 0.0;        ///< [rad/s]
  double depth = 0.0;        ///< [m]
  double probability = 0.0;  ///< [1] the largest within the margin of speed
};

/// Points of largest speed x depth, one a pocket (5 % of speed), best first. @param risk [1] @param
/// speed_margin [1]
std::vector<RobustPoint> robustPoints(const ProbabilityChart& chart, double risk, double speed_margin,
                                      int count);

}  // namespace smartmill::stability
