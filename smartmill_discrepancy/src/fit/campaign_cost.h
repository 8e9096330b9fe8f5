#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "fit/campaign_coordinates.h"
#include "fit/campaign_linearisation.h"
#include "smartmill_core/fit/least_squares.h"

namespace smartmill::discrepancy {

/// Cost of a campaign for least squares: (measured - simulated) over noise, and priors. The solver moves the
/// own coordinates; frozen ones are at their conditional optimum (variable projection: Golub and Pereyra,
/// SIAM J. Numer. Anal. 10, 1973). The some 1e5 residuals are rotated into as many as the solver has
/// unknowns, which keeps cost, gradient and normal equations.
class CampaignCost : public fit::Residuals {
 public:
  /// All arguments must outlive this object. @param frozen as in Fitter::fit()
  CampaignCost(const Fitter& fitter, const FitState& start, const NominalTangents* frozen,
               const FitOptions& options)
      : coordinates_(fitter, start, frozen, options), linearisation_(fitter, coordinates_) {}

  const CampaignCoordinates& coordinates() const { return coordinates_; }
  CampaignLinearisation& linearisation() const { return linearisation_; }
  /// Whether no coordinate is frozen.
  bool simulatesAll() const { return coordinates_.frozen().empty(); }

  Eigen::Index count() const override { return 2 * static_cast<Eigen::Index>(coordinates_.own().size()) + 1; }
  /// The own coordinates at the start.
  std::vector<fit::Parameter> parameters() const;
  /// @param own coordinates
  /// @return false if the twin rejects the point or gives no finite values
  bool evaluate(const Eigen::VectorXd& own, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

  /// All coordinates, frozen ones at their optimum. @return no value if evaluate() is false
  std::optional<Eigen::VectorXd> pointAt(const Eigen::VectorXd& own) const;

  /// All coordinates at the minimum of squares and priors if the twin were linear about this point.
  /// @return no value if evaluate() is false
  std::optional<Eigen::VectorXd> linearOptimumFrom(const Eigen::VectorXd& at) const;

  /// Reduction of squares and priors predicted for an undamped step; coordinates that push against a bound do
  /// not count.
  double predictedReductionAt(const Eigen::VectorXd& own) const;

 private:
  using Linear = CampaignLinearisation::Linear;
  Linear withFrozenEliminated(const Eigen::VectorXd& at, const Linear& of_all) const;

  CampaignCoordinates coordinates_;
  mutable CampaignLinearisation linearisation_;  // keeps its last results
};

}  // namespace smartmill::discrepancy
