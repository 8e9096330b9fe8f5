#pragma once

#include <Eigen/Core>

namespace smartmill::fit {

/// Minimises x' h x / 2 - b' x with low <= x <= high in each element, by active sets (Stark and Parker,
/// Bounded-Variable Least Squares, Computational Statistics 10, 1995).
/// @param h symmetric and positive definite @param low <= high in each element, which may be infinite
Eigen::VectorXd minimiseWithin(const Eigen::MatrixXd& h, const Eigen::VectorXd& b, const Eigen::VectorXd& low,
                               const Eigen::VectorXd& high);

}  // namespace smartmill::fit
