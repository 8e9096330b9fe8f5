#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "search/nominal_bounds.h"
#include "search/thinned_samples.h"
#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/gap/scale_evidence.h"

namespace smartmill::discrepancy {

/// Orthogonal projection off the derivatives of the nominal values (with their priors), the alignment and the
/// members: what further columns explain with all these values free.
class Projection {
 public:
  /// @param fitter, now, tangents must outlive this object
  Projection(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents);

  /// Simulation of the current fit.
  const SimulatedChannels& base() const { return base_; }
  const ThinnedSamples& thinned() const { return thinned_; }

  /// Reduction of the cost by columns with all other values free.
  struct Reduction {
    double gain = 0.0;  ///< [1] of chi2 and priors
    Eigen::VectorXd amplitudes;
    Eigen::VectorXd all_else;
  };
  Reduction reduction(const SparseColumns& columns) const;

  /// Change of the simulation with the columns relative to that without them.
  std::shared_ptr<const Eigen::VectorXd> changeBy(const SparseColumns& columns,
                                                  const Reduction& reduction) const;
  /// The same of the stated nominal values over their deviations, without variance.
  ScaleEvidence priorEvidence(const Reduction& reduction) const;
  /// Residual without the columns.
  std::shared_ptr<const Eigen::VectorXd> baselineResidual() const { return baseline_residual_; }

  /// Approximate gain from thinned columns.
  double roughGain(const Eigen::MatrixXd& columns) const;
  /// The same for single columns; 0 if a column is zero or not finite or has an impossible sign.
  Eigen::VectorXd roughGains(const Eigen::MatrixXd& columns, bool positive) const;

 private:
  Eigen::VectorXd priorsOf(const Fitter& fitter) const;
  Eigen::VectorXd pullOf(const Fitter& fitter, const FitState& state) const;
  void move(const Eigen::VectorXd& by, Eigen::VectorXd* vector) const;
  Reduction reduction(const Eigen::MatrixXd& information, const Eigen::VectorXd& score,
                      const Eigen::VectorXd& baseline, const Eigen::MatrixXd& cross, Eigen::MatrixXd own,
                      const Eigen::VectorXd& along) const;
  void thinSamples();

  const std::vector<Coordinate>& freedom_;
  const std::vector<double>& nominal_;
  const NominalTangents& tangents_;
  SimulatedChannels base_;
  SparseColumns members_;                            // derivatives of the members' values
  Eigen::VectorXd prior_, residual_, pull_, score_;  // pull: of the priors, part of the score
  Eigen::MatrixXd information_;
  NominalBounds bounds_;
  ConstrainedStep baseline_;  // without columns
  std::shared_ptr<const Eigen::VectorXd> baseline_residual_;
  ThinnedSamples thinned_;
  Eigen::MatrixXd thinned_columns_, thinned_information_, thinned_fixed_information_;
  Eigen::VectorXd thinned_residual_, thinned_baseline_residual_, thinned_score_, thinned_baseline_;
};

}  // namespace smartmill::discrepancy
