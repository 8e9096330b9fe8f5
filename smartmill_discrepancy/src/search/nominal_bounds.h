#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// Step of all values, and the nominal values at their bounds.
struct ConstrainedStep {
  Eigen::VectorXd by;
  std::vector<Eigen::Index> at_bounds;
};

/// Solves normal equations whose first values are the nominal ones, within their bounds.
class NominalBounds {
 public:
  /// @param freedom, nominal coordinates and values of the nominal model; must outlive this object
  /// @param prior precisions, of which the first are those of the nominal values
  NominalBounds(const std::vector<Coordinate>& freedom, const std::vector<double>& nominal,
                Eigen::VectorXd prior)
      : freedom_(freedom), nominal_(nominal), prior_(std::move(prior)) {}

  /// The step with values beyond a bound fixed there one by one, the furthest first; columns may bring back
  /// values that are at a bound without them.
  ConstrainedStep solve(const Eigen::MatrixXd& information, const Eigen::VectorXd& right) const;

  /// The information with values fixed at their bounds.
  Eigen::MatrixXd fixedAt(const std::vector<Eigen::Index>& at_bounds, Eigen::MatrixXd information) const;

 private:
  const std::vector<Coordinate>& freedom_;
  const std::vector<double>& nominal_;
  Eigen::VectorXd prior_;
};

}  // namespace smartmill::discrepancy
