#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/fit/least_squares.h"
#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// Cost of a campaign for least squares: (measured - simulated) over noise, then the priors. The solver moves
/// what is simulated; what acts linearly, along frozen tangents, stands at its best beside each point
/// (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). The residuals of the records, of
/// which there are some 1e5, are handed on rotated into as many as the solver has unknowns, which leaves
/// cost, gradient and normal equations as they are.
class CampaignCost : public fit::Residuals {
 public:
  /// All must outlive this. @param frozen as in Fitter::fit()
  CampaignCost(const Fitter& fitter, const FitState& start, const NominalTangents* frozen,
               const FitOptions& options);

  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  Eigen::Index count() const override { return 2 * static_cast<Eigen::Index>(own_places_.size()) + 1; }

  /// What is simulated, at the start.
  std::vector<fit::Parameter> parameters() const;
  /// All coordinates at the start, and the state of such coordinates.
  const Eigen::VectorXd& start() const { return start_point_; }
  FitState stateAt(const Eigen::VectorXd& at) const;

  /// @param own what is simulated. @return false at a point that the twin refuses or where it gives no
  /// numbers
  bool evaluate(const Eigen::VectorXd& own, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

  /// All coordinates, frozen ones at their best. @return no value where evaluate() is false
  std::optional<Eigen::VectorXd> pointAt(const Eigen::VectorXd& own) const;

  /// All coordinates where squares and priors would be least were the twin straight about this point. @return
  /// no value where evaluate() is false
  std::optional<Eigen::VectorXd> straightOn(const Eigen::VectorXd& at) const;

  /// Squares of the priors, those of turns left out.
  double penaltyAt(const Eigen::VectorXd& at) const;

  /// Squares, priors included, that an undamped step from there promises to take away; of what presses
  /// against its bound it promises nothing.
  double promisedAt(const Eigen::VectorXd& own) const;

  /// Of (simulated - measured) / noise: the normal equations without priors.
  struct Linear {
    double squares = 0.0;         ///< of the residual
    Eigen::MatrixXd information;  ///< tangents' * tangents
    Eigen::VectorXd gradient;     ///< tangents' * residual
  };
  /// @return nullptr at a point that the twin refuses or where it gives no numbers; valid until the next call
  const Linear* linearise(const Eigen::VectorXd& at) const;

  /// (simulated - measured) / noise where linearise() stands.
  Eigen::VectorXd residual(const Eigen::VectorXd& at) const;

  /// Over the samples, where linearise() stands: tangents * amplitudes.
  Eigen::VectorXd influence(const Eigen::VectorXd& amplitudes) const;

  /// From which coordinate on they are turns of records: what a prior holds of them only keeps steps short.
  std::size_t turnsBegin() const { return coordinates_.size() - turns_; }

  /// Whether nothing acts linearly.
  bool simulatesAll() const { return frozen_places_.empty(); }

  /// Of a coordinate's prior.
  double precision(std::size_t coordinate) const { return precision_[static_cast<Eigen::Index>(coordinate)]; }

 private:
  void addTurns();
  void setPoints();
  Eigen::VectorXd ownOf(const Eigen::VectorXd& at) const;
  MachineModel modelAt(const Eigen::VectorXd& at) const;
  bool simulate(const Eigen::VectorXd& at) const;
  void compare(SimulatedBlocks simulated) const;
  bool takeTangents(const Eigen::VectorXd& at) const;
  Eigen::VectorXd shiftAt(const Eigen::VectorXd& at) const;
  double frozenPenalty(const Eigen::VectorXd& at) const;
  Linear eliminated(const Eigen::VectorXd& at, const Linear& of_all) const;
  double squaresAt(const Eigen::VectorXd& at) const;
  void normalEquations(const Eigen::VectorXd& at, Linear* linear) const;

  const Fitter& fitter_;
  FitState start_;
  const NominalTangents* frozen_;
  double prior_weight_;
  std::size_t nominal_ = 0, turns_ = 0;
  std::vector<Coordinate> coordinates_;                   // nominal ones, members', turns
  std::vector<Eigen::Index> frozen_places_, own_places_;  // of the coordinates
  Eigen::VectorXd start_point_;
  // Of the coordinates.
  Eigen::VectorXd low_, high_, precision_, null_;
  // The solver comes back to the points where it is, and what is frozen moves without a simulation: own
  // values where the twin has run, where own tangents were taken; all values of the normal equations.
  mutable std::optional<Eigen::VectorXd> simulated_at_, tangents_at_, linearised_at_;
  mutable SimulatedBlocks simulated_;
  mutable Eigen::VectorXd apart_;  // (simulated - measured) / noise, of frozen nominal values where they are
  mutable Eigen::VectorXd block_squares_;  // of apart
  mutable Eigen::MatrixXd block_along_;    // frozen tangents' * apart, a column each block
  mutable double apart_squares_ = 0.0;
  mutable Eigen::VectorXd frozen_along_;           // frozen tangents' * apart
  mutable BlockColumns own_columns_;               // tangents of what is not frozen
  mutable Eigen::MatrixXd own_gram_, frozen_own_;  // own' * own, frozen' * own
  mutable Eigen::VectorXd own_along_;              // own' * apart
  mutable Linear linear_;
};

}  // namespace smartmill::discrepancy
