#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>

#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::linear {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd solve(const MatrixXd& a, const VectorXd& b) {
  return solve(a, MatrixXd(b));
}

MatrixXd solve(const MatrixXd& a, const MatrixXd& b) {
  return a.partialPivLu().solve(b);
}

MatrixXd inverse(const MatrixXd& a) {
  return solve(a, MatrixXd(MatrixXd::Identity(a.rows(), a.rows())));
}

VectorXd solveSymmetric(const MatrixXd& a, const VectorXd& b) {
  return solveSymmetric(a, MatrixXd(b));
}

MatrixXd solveSymmetric(const MatrixXd& a, const MatrixXd& b) {
  return a.ldlt().solve(b);
}

MatrixXd inverseSymmetric(const MatrixXd& a) {
  return solveSymmetric(a, MatrixXd(MatrixXd::Identity(a.rows(), a.rows())));
}

SymmetricRoot symmetricRoot(const MatrixXd& a, const VectorXd& b) {
  // a = P' L D L' P
  const Eigen::LDLT<MatrixXd> factors(a);
  const VectorXd root = factors.vectorD().cwiseMax(0.0).cwiseSqrt();
  MatrixXd rotated = factors.transpositionsP() * MatrixXd::Identity(a.rows(), a.rows());
  rotated = factors.matrixU() * rotated;
  SymmetricRoot result;
  result.root = root.asDiagonal() * rotated;
  MatrixXd along = factors.transpositionsP() * b;
  factors.matrixL().solveInPlace(along);
  result.along = VectorXd::Zero(b.size());
  for (Index i = 0; i < b.size(); ++i) {
    if (root[i] > 1e-12 * root.maxCoeff()) result.along[i] = along(i, 0) / root[i];
  }
  return result;
}

LeastSquares leastSquares(const MatrixXd& a, const MatrixXd& b) {
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(a);
  return {qr.solve(b), qr.rank()};
}

VectorXd leastNorm(const MatrixXd& a, const VectorXd& b) {
  return a.completeOrthogonalDecomposition().solve(b);
}

MatrixXd triangleOf(const MatrixXd& a) {
  const Eigen::HouseholderQR<MatrixXd> qr(a);
  return qr.matrixQR().topRows(a.cols()).triangularView<Eigen::Upper>();
}

}  // namespace smartmill::linear
