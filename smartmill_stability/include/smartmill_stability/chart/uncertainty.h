#pragma once

#include <functional>
#include <random>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Standard deviations of a mode, relative to its values.
struct ModeUncertainty {
  double frequency = 0.0;  ///< [1] >= 0
  double damping = 0.0;    ///< [1] >= 0
  double gain = 0.0;       ///< [1] >= 0, of the compliance
};

/// A distribution of systems. Frequencies are normal; damping, compliance and coefficients are log-normal
/// with the given standard deviations; all are independent.
class UncertainSystem {
 public:
  /// @param modes one entry for each mode of the system. @param kt_share, kr_share [1] relative standard
  /// deviations. @throws Error on a wrong count or a standard deviation outside 0..1.
  UncertainSystem(const RegenerativeSystem& system, std::vector<ModeUncertainty> modes, double kt_share,
                  double kr_share);

  /// Standard deviations of tool tip and cutting coefficients from a model; those it lacks are taken from its
  /// section uncertainty_percent. @param system built from the same model with systemModes(x, y)
  static UncertainSystem of(const MachineModel& model, const RegenerativeSystem& system);

  /// The same standard deviations about another system with the same number of modes.
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

/// Fraction of drawn systems that are unstable at a speed [rad/s] and depth [m]. @param draws >= 1
double chatterProbability(const UncertainSystem& system, double speed, double depth, int draws, unsigned seed,
                          Method method = Method::collocation);

/// Probability of chatter over speeds and depths.
struct ProbabilityChart {
  std::vector<double> speeds;  ///< [rad/s]
  std::vector<double> depths;  ///< [m] ascending
  /// [speed][depth] fraction of the draws whose first limit lies below the depth
  std::vector<std::vector<double>> probability;
  std::vector<double> nominal;  ///< [m] limit of the mean system
};

/// @param progress called with the completed fraction. @throws Error on empty axes.
ProbabilityChart probabilityChart(const UncertainSystem& system, const std::vector<double>& speeds,
                                  const std::vector<double>& depths, int draws, unsigned seed,
                                  const std::function<void(double)>& progress = {});

/// A cut whose probability of chatter stays below a risk at all speeds within a margin.
struct RobustPoint {
  double speed = 0.0;        ///< [rad/s]
  double depth = 0.0;        ///< [m]
  double probability = 0.0;  ///< [1] largest within the speed margin
};

/// Points with the largest speed x depth, one for each pocket (5 % of speed), best first.
/// @param risk [1] @param speed_margin [1]
std::vector<RobustPoint> robustPoints(const ProbabilityChart& chart, double risk, double speed_margin,
                                      int count);

}  // namespace smartmill::stability
