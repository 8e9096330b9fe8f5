#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::linear {

using Eigen::MatrixXcd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

VectorXcd solve(const MatrixXcd& a, const VectorXcd& b) {
  return solve(a, MatrixXcd(b));
}

MatrixXcd solve(const MatrixXcd& a, const MatrixXcd& b) {
  return a.partialPivLu().solve(b);
}

MatrixXcd inverse(const MatrixXcd& a) {
  return solve(a, MatrixXcd(MatrixXcd::Identity(a.rows(), a.rows())));
}

VectorXcd solveSymmetric(const MatrixXcd& a, const VectorXcd& b) {
  return solveSymmetric(a, MatrixXcd(b));
}

MatrixXcd solveSymmetric(const MatrixXcd& a, const MatrixXcd& b) {
  return a.ldlt().solve(b);
}

MatrixXcd inverseSymmetric(const MatrixXcd& a) {
  return solveSymmetric(a, MatrixXcd(MatrixXcd::Identity(a.rows(), a.rows())));
}

VectorXd singularValues(const MatrixXcd& a) {
  return Eigen::JacobiSVD<MatrixXcd>(a).singularValues();
}

VectorXcd eigenvalues(const MatrixXcd& a) {
  return Eigen::ComplexEigenSolver<MatrixXcd>(a, false).eigenvalues();
}

}  // namespace smartmill::linear
