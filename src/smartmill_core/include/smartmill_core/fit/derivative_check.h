#pragma once

#include <Eigen/Core>

#include "smartmill_core/fit/least_squares.h"

namespace smartmill::fit {

/// Where a Jacobian differs most from differences (Ridders' extrapolation), over the largest number of the
/// column.
struct DerivativeGap {
  double relative = 0.0;
  Eigen::Index row = 0, column = 0;
  double given = 0.0, numeric = 0.0;
};

/// Checks evaluate()'s derivatives at a point, for tests. @throws Error where the point or one beside it is
/// refused.
DerivativeGap checkDerivatives(const Residuals& residuals, const Eigen::VectorXd& at);

}  // namespace smartmill::fit
