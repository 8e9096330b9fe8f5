#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/fit/least_squares.h"
#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// Cost of a campaign for least squares: (measured - simulated) over noise, and priors. The solver moves the
/// simulated coordinates; coordinates that act linearly along frozen derivatives are at their conditional
/// optimum (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). The some 1e5 residuals
/// are rotated into as many as the solver has unknowns, which keeps cost, gradient and normal equations.
class CampaignCost : public fit::Residuals {
 public:
  /// All arguments must outlive this object. @param frozen as in Fitter::fit()
  CampaignCost(const Fitter& fitter, const FitState& start, const NominalTangents* frozen,
               const FitOptions& options);

  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  Eigen::Index count() const override { return 2 * static_cast<Eigen::Index>(own_indices_.size()) + 1; }

  /// The simulated coordinates at the start.
  std::vector<fit::Parameter> parameters() const;
  /// All coordinates at the start, and the state of given coordinates.
  const Eigen::VectorXd& start() const { return start_point_; }
  FitState stateAt(const Eigen::VectorXd& at) const;

  /// @param own simulated coordinates
  /// @return false if the twin rejects the point or gives no finite values
  bool evaluate(const Eigen::VectorXd& own, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

  /// All coordinates, frozen ones at their optimum. @return no value if evaluate() is false
  std::optional<Eigen::VectorXd> pointAt(const Eigen::VectorXd& own) const;

  /// All coordinates at the minimum of squares and priors if the twin were linear about this point.
  /// @return no value if evaluate() is false
  std::optional<Eigen::VectorXd> linearOptimumFrom(const Eigen::VectorXd& at) const;

  /// Squares of the priors without those of the alignment.
  double penaltyAt(const Eigen::VectorXd& at) const;

  /// Reduction of squares and priors predicted for an undamped step; coordinates that push against a bound do
  /// not count.
  double predictedReductionAt(const Eigen::VectorXd& own) const;

  /// Normal equations of (simulated - measured) / noise without priors.
  struct Linear {
    double squares = 0.0;         ///< of the residual
    Eigen::MatrixXd information;  ///< tangents' * tangents
    Eigen::VectorXd gradient;     ///< tangents' * residual
  };
  /// @return nullptr if the twin rejects the point or gives no finite values; valid until the next call
  const Linear* linearise(const Eigen::VectorXd& at) const;

  /// (simulated - measured) / noise at the point of linearise().
  Eigen::VectorXd residual(const Eigen::VectorXd& at) const;

  /// Derivatives * amplitudes over the samples, at the point of linearise().
  Eigen::VectorXd influence(const Eigen::VectorXd& amplitudes) const;

  /// Index of the first alignment coordinate; its prior only limits the step.
  std::size_t alignmentBegin() const { return coordinates_.size() - alignment_count_; }

  /// Whether no coordinate is frozen.
  bool simulatesAll() const { return frozen_indices_.empty(); }

  /// Of a coordinate's prior.
  double precision(std::size_t coordinate) const { return precision_[static_cast<Eigen::Index>(coordinate)]; }

 private:
  void addAlignments();
  void setPoints();
  Eigen::VectorXd ownOf(const Eigen::VectorXd& at) const;
  MachineModel modelAt(const Eigen::VectorXd& at) const;
  bool simulate(const Eigen::VectorXd& at) const;
  void compare(SimulatedChannels simulated) const;
  bool updateTangents(const Eigen::VectorXd& at) const;
  Eigen::VectorXd shiftAt(const Eigen::VectorXd& at) const;
  double frozenPenalty(const Eigen::VectorXd& at) const;
  Linear withFrozenEliminated(const Eigen::VectorXd& at, const Linear& of_all) const;
  double squaresAt(const Eigen::VectorXd& at) const;
  void normalEquations(const Eigen::VectorXd& at, Linear* linear) const;

  const Fitter& fitter_;
  FitState start_;
  const NominalTangents* frozen_;
  double prior_weight_;
  std::size_t nominal_ = 0, alignment_count_ = 0;
  std::vector<Coordinate> coordinates_;                     // nominal, members', alignment
  std::vector<Eigen::Index> frozen_indices_, own_indices_;  // of the coordinates
  Eigen::VectorXd start_point_;
  // Of the coordinates.
  Eigen::VectorXd low_, high_, precision_, null_;
  // Points of the cached results, since the solver returns to earlier points: simulated coordinates of the
  // simulation and of the derivatives; all coordinates of the normal equations.
  mutable std::optional<Eigen::VectorXd> simulated_at_, tangents_at_, linearised_at_;
  mutable SimulatedChannels simulated_;
  mutable Eigen::VectorXd
      difference_;  // (simulated - measured) / noise, frozen nominal values at their derivatives' point
  mutable Eigen::VectorXd span_squares_;  // of difference_
  mutable Eigen::MatrixXd span_along_;    // frozen derivatives' * difference_, one column per span
  mutable double difference_squares_ = 0.0;
  mutable Eigen::VectorXd frozen_along_;           // frozen derivatives' * difference_
  mutable SparseColumns own_columns_;              // derivatives of the simulated coordinates
  mutable Eigen::MatrixXd own_gram_, frozen_own_;  // own' * own, frozen' * own
  mutable Eigen::VectorXd own_along_;              // own' * difference_
  mutable Linear linear_;
};

}  // namespace smartmill::discrepancy
