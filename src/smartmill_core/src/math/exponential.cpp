#include <unsupported/Eigen/MatrixFunctions>

#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::linear {

Eigen::MatrixXd exponential(const Eigen::MatrixXd& a) {
  return a.size() == 0 ? a : Eigen::MatrixXd(a.exp());
}

}  // namespace smartmill::linear
