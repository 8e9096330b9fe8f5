#include "solvers/arnoldi.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

Complex largest(const Eigen::MatrixXd& h) {
  Eigen::RealSchur<Eigen::MatrixXd> schur(h.rows());
  schur.computeFromHessenberg(h, Eigen::MatrixXd(), false);
  const Eigen::MatrixXd& t = schur.matrixT();
  Complex best = 0.0;
  const auto consider = [&](Complex value) {
    if (std::abs(value) > std::abs(best)) best = value;
  };
  for (Index i = 0; i < t.rows(); ++i) {
    if (i + 1 < t.rows() && t(i + 1, i) != 0.0) {
      const double half = 0.5 * (t(i, i) - t(i + 1, i + 1));
      const double middle = 0.5 * (t(i, i) + t(i + 1, i + 1));
      consider(middle + std::sqrt(Complex(half * half + t(i, i + 1) * t(i + 1, i))));
      ++i;
    } else {
      consider(t(i, i));
    }
  }
  return {best.real(), std::abs(best.imag())};
}

}  // namespace

Dominant dominantEigenvalue(const std::function<void(const Eigen::VectorXd&, Eigen::VectorXd&)>& map,
                            Index size, double tolerance, bool with_vector, Index& expected) {
  constexpr Index FIRST = 6, STEP = 3;
  const Index most = std::min<Index>(size, 150);
  Eigen::MatrixXd basis(size, most + 1), h = Eigen::MatrixXd::Zero(most + 1, most);
  // A fixed start without symmetry, which is not orthogonal to the dominant eigenvector.
  for (Index i = 0; i < size; ++i) basis(i, 0) = 1.0 + std::sin(1.3 * static_cast<double>(i * i) + 0.7);
  basis.col(0).normalize();
  Eigen::VectorXd in(size), out(size), share;
  Complex value = 0.0;
  Index k = 0, check = std::max(FIRST, expected - 2 * STEP);
  while (k < most) {
    in = basis.col(k);
    map(in, out);
    const double before = out.norm();
    // Two passes of Gram-Schmidt are sufficient.
    for (int pass = 0; pass < 2; ++pass) {
      share = basis.leftCols(k + 1).transpose() * out;
      out.noalias() -= basis.leftCols(k + 1) * share;
      h.col(k).head(k + 1) += share;
    }
    const double norm = out.norm();
    ++k;
    const bool exhausted = k == most || norm <= 1e-14 * before;
    if (!exhausted) {
      h(k, k - 1) = norm;
      basis.col(k) = out / norm;
    }
    if (exhausted || (k == check)) {
      const Complex found = largest(h.topLeftCorner(k, k));
      const bool settled = std::abs(found - value) <= tolerance * std::abs(found);
      value = found;
      if (exhausted || settled) break;
      check = k + STEP;
    }
  }
  expected = k;
  Dominant result{value, {}};
  if (with_vector) {
    // Inverse iteration on the small matrix.
    Eigen::MatrixXcd shifted = h.topLeftCorner(k, k).cast<Complex>();
    const Complex near = value * (1.0 + 1e-10) + Complex(1e-300, 0.0);
    shifted.diagonal().array() -= near;
    const Eigen::PartialPivLU<Eigen::MatrixXcd> lu(shifted);
    Eigen::VectorXcd y = Eigen::VectorXcd::Ones(k);
    for (int i = 0; i < 3; ++i) y = lu.solve(y).normalized();
    result.vector = basis.leftCols(k).cast<Complex>() * y;
  }
  return result;
}

}  // namespace smartmill::stability
