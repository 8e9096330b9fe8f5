#pragma once

#include <Eigen/Core>

namespace smartmill::linear {

/// Decompositions of dynamic matrices, compiled once: each costs a file that includes Eigen's 10 to 50 s.
/// They do not throw unless stated; a singular matrix gives numbers that are not finite.

/// x of a x = b by LU with partial pivoting: a square and regular.
Eigen::VectorXd solve(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);
Eigen::MatrixXd solve(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
Eigen::VectorXcd solve(const Eigen::MatrixXcd& a, const Eigen::VectorXcd& b);
Eigen::MatrixXcd solve(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b);
Eigen::MatrixXd inverse(const Eigen::MatrixXd& a);
Eigen::MatrixXcd inverse(const Eigen::MatrixXcd& a);

/// x of a x = b by Cholesky's L D L': a symmetric (Hermitian) and positive semidefinite; only its lower
/// triangle is read.
Eigen::VectorXd solveSymmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);
Eigen::MatrixXd solveSymmetric(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
Eigen::VectorXcd solveSymmetric(const Eigen::MatrixXcd& a, const Eigen::VectorXcd& b);
Eigen::MatrixXcd solveSymmetric(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b);
Eigen::MatrixXd inverseSymmetric(const Eigen::MatrixXd& a);
Eigen::MatrixXcd inverseSymmetric(const Eigen::MatrixXcd& a);

/// R with a = R' R for a symmetric positive semidefinite matrix: sqrt(D) L' with its columns in a's order,
/// and the permuted solution of R' y = b. Zero pivots give zero rows of R and zero in y.
struct SymmetricRoot {
  Eigen::MatrixXd root;
  Eigen::VectorXd along;
};
SymmetricRoot symmetricRoot(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

/// Least squares of a x - b by QR with column pivoting.
struct LeastSquares {
  Eigen::MatrixXd x;
  Eigen::Index rank = 0;  ///< of a; below its columns x is one solution of many
};
LeastSquares leastSquares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// The x of minimum norm among those that minimise |a x - b| (the pseudo-inverse of a times b), by complete
/// orthogonal decomposition.
Eigen::VectorXd leastNorm(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

/// R of a = Q R: upper triangle, as many rows as a has columns (a has at least as many rows).
Eigen::MatrixXd triangleOf(const Eigen::MatrixXd& a);

/// Singular values, largest first.
Eigen::VectorXd singularValues(const Eigen::MatrixXd& a);
Eigen::VectorXd singularValues(const Eigen::MatrixXcd& a);

/// a = u diag(values) v', largest value first; u and v have as many columns as there are values, v all of
/// them with `full_v`.
struct Svd {
  Eigen::MatrixXd u, v;
  Eigen::VectorXd values;
};
Svd svd(const Eigen::MatrixXd& a, bool full_v = false);

Eigen::VectorXcd eigenvalues(const Eigen::MatrixXd& a);
Eigen::VectorXcd eigenvalues(const Eigen::MatrixXcd& a);

/// a v = v diag(values). @throws Error when the iteration does not converge.
struct Eigensystem {
  Eigen::VectorXcd values;
  Eigen::MatrixXcd vectors;
};
Eigensystem eigensystem(const Eigen::MatrixXd& a);

/// Of a symmetric matrix (its lower triangle is read), smallest value first.
struct SymmetricEigensystem {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigensystem symmetricEigensystem(const Eigen::MatrixXd& a);

/// exp(a)
Eigen::MatrixXd exponential(const Eigen::MatrixXd& a);

}  // namespace smartmill::linear
