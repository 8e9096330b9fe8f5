#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "load_record.h"
#include "load_terms.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/calibration/fit.h"
#include "smartmill_loadmeter/calibration/friction_law.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

namespace smartmill::loadmeter {

/// Fit of condensed records.
struct LoadSolution {
  LoadTerms terms;
  FitResult fit;
  double bic = 0.0;
  double freedom = 1.0;       ///< degrees of freedom
  double misfit = 0.0;        ///< [1] chi2 per degree of freedom
  double disagreement = 0.0;  ///< [1] RMS of the residual over that of the records' voltage

  double ktc() const { return fit.value[terms.ktcIndex()]; }
  double kte() const { return fit.value[terms.ktcIndex() + 1]; }
};

/// Records condensed about a point of linearisation, and the solution there. A value: alternatives are fitted
/// to copies.
struct LoadState {
  std::vector<LoadRecord> records;
  double noise = 0.0;  ///< [V]
  LoadPoint point;
  double log_lag = 0.0;  ///< log of (time constant / the model's)
  double growth = 0.0;   ///< [1/s]
  FrictionLaw friction;  ///< start of the next fit
  LoadSolution solution;
};

struct LoadRegressionOptions {
  /// [1] accuracy of the model: a smaller disagreement over the voltage increases the standard deviations,
  /// but no term is added for it.
  double model_accuracy = 2e-4;
  /// [1] standard deviations by which chi2 exceeds its mean when records disagree: 1 % by chance.
  double significant = 2.7;
  /// @{ [1] passes of condensing and fitting. More where the columns depend on the solution: those of the lag
  /// on its time constant, those of the runout on its offset.
  int passes = 2, passes_with_lag = 4, passes_with_runout = 6;
  /// @}
};

/// Least squares of friction, coefficients and further terms over condensed records.
class LoadRegression {
 public:
  /// @param spindle_uncertainty [1] of the model's spindle section. Without transients in the plan
  /// the noise is not estimated from the samples.
  LoadRegression(const LoadPlan& plan, const Spindle& spindle, double spindle_uncertainty,
                 const LoadRecordOptions& options, const LoadRegressionOptions& regression = {});

  LoadState initialState(std::vector<LoadRecord> records, double noise) const;
  LoadTerms initialTerms() const;
  std::size_t residualCount(const LoadState& state) const;
  /// Fit of the records as they are condensed. @param start of the friction's unknowns
  LoadSolution solve(const LoadState& state, const LoadTerms& terms, const FrictionLaw& start) const;
  /// Condenses the records and fits them, repeatedly: the columns of lag and runout depend on the solution.
  LoadState converge(LoadState state, const LoadTerms& terms) const;
  /// Whether the records disagree significantly, beyond the accuracy of the model.
  bool recordsDisagree(const LoadSolution& solution) const;
  FrictionLaw frictionOf(const LoadSolution& solution) const;
  /// Covariance of all unknowns: the larger of noise and scatter between the records, and the rounding error
  /// of each record.
  Eigen::MatrixXd covariance(const LoadState& state) const;
  double timeConstantOf(const LoadState& state) const;  ///< [s] of the load meter

  const Spindle& spindle() const { return spindle_; }

 private:
  struct Prior {
    std::size_t unknown;
    double value, std_dev;
  };
  /// Unknowns of a fit as quantities.
  struct Unknowns {
    FrictionLaw friction;
    double ktc = 0.0, kte = 0.0, growth = 0.0, log_lag = 0.0;
    Runout runout;
  };
  Unknowns unknownsOf(const LoadState& state, const LoadTerms& terms, const std::vector<double>& value) const;

  void residuals(const LoadState& state, const LoadTerms& terms, const std::vector<double>& value,
                 double* out) const;
  void condense(LoadState* state) const;
  Eigen::MatrixXd jacobian(const LoadState& state) const;

  LoadPlan plan_;
  Spindle spindle_;
  LoadRegressionOptions options_;
  std::vector<Prior> friction_priors_;
  double runout_prior_ = 0.0;  // [m] standard deviation of each component; 0: none
  double lag_prior_ = 0.0;     // standard deviation of the log time constant; 0: none
};

}  // namespace smartmill::loadmeter
