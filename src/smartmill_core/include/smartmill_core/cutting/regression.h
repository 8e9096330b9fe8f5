#pragma once

#include <vector>

#include <Eigen/Core>

#include "smartmill_core/cutting/mechanistic.h"

namespace smartmill {

/// Mean forces of one cut, for the identification of coefficients.
struct MeanForceTest {
  ToolGeometry tool;
  Engagement engagement;
  std::array<double, 3> force{{0, 0, 0}};      ///< [N] mean fx, fy, fz on the tool
  std::array<double, 3> force_std{{0, 0, 0}};  ///< [N] of the means; zero: unweighted
};

struct IdentifiedCoefficients {
  CuttingCoefficients value;
  CuttingCoefficients std_dev;
  Eigen::MatrixXd covariance;  ///< 6x6 in the order ktc, krc, kac, kte, kre, kae
  int tests = 0;
  double r_squared_x = 0.0, r_squared_y = 0.0, r_squared_z = 0.0;  ///< [1] of the mean forces
};

/// Mean-force regression over tests of at least two feeds (all three forces together).
/// Unweighted when every std is zero: then the standard deviations follow from the residuals of each axis.
/// @throws Error with too few feeds or a rank-deficient plan.
IdentifiedCoefficients identifyFromForces(const std::vector<MeanForceTest>& tests);

}  // namespace smartmill
