#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::linear {

using Eigen::MatrixXd;

Eigen::VectorXd singularValues(const MatrixXd& a) {
  return Eigen::JacobiSVD<MatrixXd>(a).singularValues();
}

Svd svd(const MatrixXd& a, bool full_v) {
  const Eigen::JacobiSVD<MatrixXd> made(
      a, Eigen::ComputeThinU | (full_v ? Eigen::ComputeFullV : Eigen::ComputeThinV));
  return {made.matrixU(), made.matrixV(), made.singularValues()};
}

Eigen::VectorXcd eigenvalues(const MatrixXd& a) {
  return Eigen::EigenSolver<MatrixXd>(a, false).eigenvalues();
}

Eigensystem eigensystem(const MatrixXd& a) {
  const Eigen::EigenSolver<MatrixXd> made(a);
  if (made.info() != Eigen::Success) throw Error("eigenvalues: the iteration does not converge");
  return {made.eigenvalues(), made.eigenvectors()};
}

SymmetricEigensystem symmetricEigensystem(const MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> made(a);
  return {made.eigenvalues(), made.eigenvectors()};
}

}  // namespace smartmill::linear
