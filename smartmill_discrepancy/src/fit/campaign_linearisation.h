#pragma once

#include <optional>

#include <Eigen/Core>

#include "fit/campaign_coordinates.h"

namespace smartmill::discrepancy {

/// Simulation of a campaign and its derivatives at a point of all coordinates. The last results are kept,
/// since the solver returns to earlier points.
class CampaignLinearisation {
 public:
  /// Both arguments must outlive this object.
  CampaignLinearisation(const Fitter& fitter, const CampaignCoordinates& coordinates)
      : fitter_(fitter), coordinates_(coordinates) {}

  /// Moves to a point. @return false if the twin rejects it or gives no finite values
  bool simulate(const Eigen::VectorXd& at);
  /// Squares of (simulated - measured) / noise, without iterating over the samples. @param at of simulate()
  double squaresAt(const Eigen::VectorXd& at) const;
  /// Frozen derivatives' * residual at the point of the derivatives.
  const Eigen::VectorXd& frozenAlong() const { return frozen_along_; }

  /// Normal equations of (simulated - measured) / noise without priors.
  struct Linear {
    double squares = 0.0;         ///< of the residual
    Eigen::MatrixXd information;  ///< tangents' * tangents
    Eigen::VectorXd gradient;     ///< tangents' * residual
  };
  /// @return nullptr if the twin rejects the point or gives no finite values; valid until the next call
  const Linear* linearise(const Eigen::VectorXd& at);
  /// (simulated - measured) / noise at the point of linearise().
  Eigen::VectorXd residual(const Eigen::VectorXd& at) const;
  /// Derivatives * amplitudes over the samples, at the point of linearise().
  Eigen::VectorXd influence(const Eigen::VectorXd& amplitudes) const;

 private:
  bool hasFrozen() const { return !coordinates_.frozen().empty(); }
  void compare(SimulatedChannels simulated);
  bool updateTangents(const Eigen::VectorXd& at);
  void setNormalEquations(const Eigen::VectorXd& at);

  const Fitter& fitter_;
  const CampaignCoordinates& coordinates_;
  // Points of the results: own coordinates of the simulation and of the derivatives; all coordinates of the
  // normal equations.
  std::optional<Eigen::VectorXd> simulated_at_, tangents_at_, linearised_at_;
  SimulatedChannels simulated_;
  Eigen::VectorXd
      difference_;  // (simulated - measured) / noise, frozen nominal values at their derivatives' point
  Eigen::VectorXd span_squares_;  // of difference_
  Eigen::MatrixXd span_along_;    // frozen derivatives' * difference_, one column per span
  double difference_squares_ = 0.0;
  Eigen::VectorXd frozen_along_;           // frozen derivatives' * difference_
  SparseColumns own_columns_;              // derivatives of the own coordinates
  Eigen::MatrixXd own_gram_, frozen_own_;  // own' * own, frozen' * own
  Eigen::VectorXd own_along_;              // own' * difference_
  Linear linear_;
};

}  // namespace smartmill::discrepancy
