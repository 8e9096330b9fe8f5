#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/fit/least_squares.h"
#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// Cost of a campaign for least squares: (measured - simulated) over noise, then the priors. The residuals of
/// the records, of which there are some 1e5, are handed on rotated into as many as there are coordinates,
/// which leaves cost, gradient and normal equations as they are.
class CampaignCost : public fit::Residuals {
 public:
  /// All must outlive this. @param frozen as in Fitter::fit()
  CampaignCost(const Fitter& fitter, const FitState& start, const NominalTangents* frozen,
               const FitOptions& options);

  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  Eigen::Index count() const override { return 2 * static_cast<Eigen::Index>(coordinates_.size()) + 1; }

  /// Unknowns of a fit that begins at the start, and the state of such unknowns.
  std::vector<fit::Parameter> parameters() const;
  FitState stateAt(const Eigen::VectorXd& at) const;

  /// @return false at a point that the twin refuses or where it gives no numbers
  bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

  /// (simulated - measured) / noise and, where asked, the normal equations without priors.
  struct Linear {
    Eigen::VectorXd residual;
    Eigen::MatrixXd information;  ///< tangents' * tangents
    Eigen::VectorXd gradient;     ///< tangents' * residual
  };
  /// @return nullptr at a point that the twin refuses or where it gives no numbers; valid until the next call
  const Linear* linearise(const Eigen::VectorXd& at) const;

  /// Of a coordinate's prior.
  double precision(std::size_t coordinate) const;

 private:
  MachineModel modelAt(const Eigen::VectorXd& at) const;
  bool simulate(const Eigen::VectorXd& at) const;
  bool tangentsAt(const Eigen::VectorXd& at, Eigen::MatrixXd* own) const;
  bool residualAt(const Eigen::VectorXd& at, Eigen::VectorXd* residual) const;
  void normalEquations(const Eigen::MatrixXd& own, Linear* linear) const;

  const Fitter& fitter_;
  FitState start_;
  const NominalTangents* frozen_;
  double prior_weight_;
  std::size_t nominal_ = 0;
  std::vector<Coordinate> coordinates_;
  // The solver comes back to the points where it is.
  mutable Eigen::VectorXd simulated_at_, linearised_at_;
  mutable std::vector<double> simulated_;
  mutable Linear linear_;
  mutable Eigen::MatrixXd frozen_information_;
};

}  // namespace smartmill::discrepancy
