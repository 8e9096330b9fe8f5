#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/learning/judged_cut.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

struct ProcessDampingOptions {
  /// [1] Standard deviation of log(limit) from cut to cut: speed, depth and engagement are not exactly the
  /// stated ones, and a verdict near the limit is uncertain.
  double scatter = 0.05;
  /// [1] Standard deviation of a factor on all limits of the chart: errors of modes and coefficients. The
  /// cuts at high speed, which process damping does not affect, determine it.
  double scale_std = 0.1;
  /// @throws Error naming the quantity and its value.
  void validate() const;
};

struct ProcessDampingEstimate {
  double coefficient = 0.0;  ///< [N/m] of greatest likelihood
  double std_dev = 0.0;      ///< [N/m] about it, of the normalised likelihood
  double scale = 1.0;        ///< [1] factor on the limits of the chart
  int contradictions = 0;    ///< cuts more than three scatters on the wrong side of the limit
};

/// Estimates the coefficient of process damping from cuts at several speeds by maximum likelihood over the
/// chart: a cut of depth b chatters with the probability
///
///     Phi(log(b / (scale b_lim(n, C))) / scatter),   log(scale) ~ N(0, scale_std^2)
///
/// with b_lim the limit by collocation at the speed n and the coefficient C. The likelihood is integrated
/// over the scale. Its root mean square width about the maximum is the standard deviation: with a few cuts
/// the likelihood has wider tails than its curvature shows. The limits are computed on a geometric grid of C
/// on demand and shared by several estimates.
class ProcessDampingChart {
 public:
  /// @param system with modes and a diameter; its process damping is not used @param cuts at whose speeds and
  /// up to whose depths limits are needed. @throws Error on cuts without a positive speed or depth.
  ProcessDampingChart(const RegenerativeSystem& system, const std::vector<JudgedCut>& cuts);

  /// [m] Limit at a speed of the cuts and a coefficient [N/m]; at most the depth up to which limits matter.
  double limit(double speed, double coefficient);

  /// @param cuts at the speeds given to the constructor. @throws Error when they do not bound the coefficient
  /// from above: no cut chatters where process damping matters.
  ProcessDampingEstimate estimate(const std::vector<JudgedCut>& cuts, const ProcessDampingOptions& options);

 private:
  /// Likelihood integrated over the scale, and its mean scale.
  struct Marginal {
    double log_likelihood = 0.0, log_scale = 0.0;
  };
  double valueAt(double position) const;
  double positionAt(double coefficient) const;
  double logLimitAt(int index, double speed);
  double logLimit(double speed, double position);
  Marginal marginal(const std::vector<JudgedCut>& cuts, const ProcessDampingOptions& options,
                    double position);

  RegenerativeSystem system_;
  double first_ = 0.0;      // [N/m] least coefficient of the grid above 0
  double max_depth_ = 0.0;  // [m]
  std::map<int, std::map<double, double>> log_limits_;
};

/// The model with the effect process_damping of an estimate, in place of the one it has.
MachineModel withProcessDamping(MachineModel model, const ProcessDampingEstimate& estimate);

/// [1] Standard deviation of a factor on the limits of a model at some speeds [rad/s], from the uncertainty
/// of its modes and coefficients: drawn machines by the zero-order solution, mean over the speeds.
double limitScaleStd(const MachineModel& model, const RegenerativeSystem& system,
                     const std::vector<JudgedCut>& cuts);

}  // namespace smartmill::stability
