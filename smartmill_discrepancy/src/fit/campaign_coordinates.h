#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

struct AlignmentReachOptions {
  double rotation = 0.05;  ///< [rad] in which the derivatives of phase and drift are valid
  double entry = 1.0;      ///< [samples] in which the derivative of an entry is valid
};

/// Coordinates of a fit: nominal values, values of the members, alignment. Those with frozen derivatives act
/// linearly; the others, its own, are simulated.
class CampaignCoordinates {
 public:
  /// All arguments must outlive this object. @param frozen as in Fitter::fit()
  /// @throws Error if nominal values are frozen and not free
  CampaignCoordinates(const Fitter& fitter, const FitState& start, const NominalTangents* frozen,
                      const FitOptions& options, const AlignmentReachOptions& reach = {});

  const std::vector<Coordinate>& all() const { return all_; }
  std::size_t size() const { return all_.size(); }
  const std::vector<Eigen::Index>& own() const { return own_; }        ///< indices
  const std::vector<Eigen::Index>& frozen() const { return frozen_; }  ///< indices
  const NominalTangents& frozenTangents() const { return *frozen_tangents_; }

  // Of all coordinates.
  const Eigen::VectorXd& start() const { return start_; }
  const Eigen::VectorXd& low() const { return low_; }
  const Eigen::VectorXd& high() const { return high_; }
  const Eigen::VectorXd& precision() const { return precision_; }  ///< of the priors
  const Eigen::VectorXd& null() const { return null_; }            ///< of the priors

  FitState stateAt(const Eigen::VectorXd& at) const;
  /// Model to simulate: frozen nominal values at the point of their derivatives.
  MachineModel modelAt(const Eigen::VectorXd& at) const;
  /// Of the frozen coordinates from the point of their derivatives.
  Eigen::VectorXd shiftAt(const Eigen::VectorXd& at) const;

  /// Squares of the priors without those of the alignment, which only limit the step.
  double penaltyAt(const Eigen::VectorXd& at) const;
  /// The same of the frozen coordinates, alignment included.
  double frozenPenaltyAt(const Eigen::VectorXd& at) const;

 private:
  void addAlignments(const AlignmentReachOptions& reach);
  void setPoints(double prior_weight);

  const Fitter& fitter_;
  FitState start_state_;
  const NominalTangents* frozen_tangents_;
  std::size_t nominal_count_ = 0, alignment_count_ = 0;
  std::vector<Coordinate> all_;
  std::vector<Eigen::Index> frozen_, own_;
  Eigen::VectorXd start_, low_, high_, precision_, null_;
};

}  // namespace smartmill::discrepancy
