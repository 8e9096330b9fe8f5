#pragma once

#include <Eigen/Core>

#include "smartmill_core/fit/least_squares.h"

namespace smartmill::fit {

/// Largest deviation of a Jacobian from numerical differences (Ridders' extrapolation), relative to the
/// largest element of its column.
struct DerivativeGap {
  double relative = 0.0;
  Eigen::Index row = 0, column = 0;
  double given = 0.0, numeric = 0.0;
};

/// Checks evaluate()'s derivatives at a point, for tests. @throws Error where the residuals are undefined at
/// the point or near it.
DerivativeGap checkDerivatives(const Residuals& residuals, const Eigen::VectorXd& at);

}  // namespace smartmill::fit
