#include "smartmill_core/cutting/regression.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <Eigen/Cholesky>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/error.h"

namespace smartmill {

namespace {

constexpr double NOT_KNOWN = std::numeric_limits<double>::quiet_NaN();

std::array<double*, 6> inOrder(CuttingCoefficients& k) {
  return {&k.ktc, &k.krc, &k.kac, &k.kte, &k.kre, &k.kae};
}

// Mean chip thickness over the arc, which separates Kc from Ke.
double meanChip(const std::array<std::array<double, 6>, 4>& m) {
  return m[2][2] / m[2][5];
}

std::size_t differentChips(const std::vector<double>& chips) {
  std::vector<double> sorted = chips;
  std::sort(sorted.begin(), sorted.end());
  std::size_t count = sorted.empty() ? 0 : 1;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    if (sorted[i] > sorted[i - 1] * (1.0 + 1e-6)) ++count;
  }
  return count;
}

struct Fit {
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
  Eigen::VectorXd residual;  // unweighted
};

// Rows X beta = y divided by their standard deviations if given, columns scaled to unit length.
struct Scaled {
  Eigen::MatrixXd a;
  Eigen::VectorXd b;
  Eigen::VectorXd scale;  // of each column
  bool weighted;
};

Scaled scaled(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, const Eigen::VectorXd& sigma) {
  Scaled s{x, y, {}, sigma.maxCoeff() > 0.0};
  if (s.weighted) {
    if (!(sigma.minCoeff() > 0.0))
      throw Error("regression of coefficients: some tests state a standard deviation and some do not");
    s.a = sigma.cwiseInverse().asDiagonal() * s.a;
    s.b = s.b.cwiseQuotient(sigma);
  }
  s.scale = s.a.colwise().norm().transpose();
  if (!(s.scale.minCoeff() > 0.0)) {
    throw Error("regression of coefficients: one coefficient does not affect any test");
  }
  s.a = s.a * s.scale.cwiseInverse().asDiagonal();
  return s;
}

// Covariance from the residuals of unweighted rows: one variance per group from its residuals and its share
// of the degrees of freedom, propagated through the solution. @param inverse of the normal matrix
Eigen::MatrixXd covarianceOfGroups(const Eigen::MatrixXd& a, const Eigen::VectorXd& rest,
                                   const Eigen::MatrixXd& inverse, const std::vector<int>& group) {
  const Eigen::Index n = a.rows(), p = a.cols();
  const int groups = *std::max_element(group.begin(), group.end()) + 1;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(groups), freedom = Eigen::VectorXd::Zero(groups);
  std::vector<Eigen::MatrixXd> normal(static_cast<std::size_t>(groups), Eigen::MatrixXd::Zero(p, p));
  for (Eigen::Index i = 0; i < n; ++i) {
    const int g = group[static_cast<std::size_t>(i)];
    sum[g] += rest[i] * rest[i];
    freedom[g] += 1.0 - (a.row(i) * inverse * a.row(i).transpose())(0, 0);
    normal[static_cast<std::size_t>(g)] += a.row(i).transpose() * a.row(i);
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(p, p);
  // A group that does not depend on a coefficient must not make it NaN.
  for (int g = 0; g < groups; ++g) {
    const double variance = freedom[g] > 1e-6 ? sum[g] / freedom[g] : NOT_KNOWN;
    const Eigen::MatrixXd part = inverse * normal[static_cast<std::size_t>(g)] * inverse;
    for (Eigen::Index i = 0; i < p; ++i) {
      for (Eigen::Index j = 0; j < p; ++j) {
        if (std::abs(part(i, j)) > 1e-12 * inverse.diagonal().maxCoeff())
          covariance(i, j) += part(i, j) * variance;
      }
    }
  }
  return covariance;
}

// Least squares of rows X beta = y in groups (fx, fy, fz). With sigma of every row: weighted, covariance from
// sigma, scaled up where the scatter exceeds it. Without: unweighted, covarianceOfGroups().
Fit leastSquares(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, const Eigen::VectorXd& sigma,
                 const std::vector<int>& group) {
  // Columns differ by the chip thickness in metres. Scaled to unit length the 6x6 normal matrix is well
  // conditioned, and a second pass on the residual removes the rounding error.
  const Scaled s = scaled(x, y, sigma);
  const Eigen::Index n = x.rows(), p = x.cols();
  const Eigen::MatrixXd normal = s.a.transpose() * s.a;
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  if (solver.info() != Eigen::Success || solver.vectorD().minCoeff() < 1e-10) {
    throw Error(
        "regression of coefficients: the tests do not separate the coefficients (chip thickness hardly "
        "differs)");
  }
  Eigen::VectorXd beta = solver.solve(s.a.transpose() * s.b);
  beta += solver.solve(s.a.transpose() * (s.b - s.a * beta));
  const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(p, p));

  Fit fit;
  fit.value = beta.cwiseQuotient(s.scale);
  fit.residual = y - x * fit.value;
  const Eigen::VectorXd rest = s.b - s.a * beta;
  const double chi2 = n > p ? rest.squaredNorm() / static_cast<double>(n - p) : 1.0;
  const Eigen::MatrixXd covariance = s.weighted ? Eigen::MatrixXd(inverse * std::max(1.0, chi2))
                                                : covarianceOfGroups(s.a, rest, inverse, group);
  fit.covariance = s.scale.cwiseInverse().asDiagonal() * covariance * s.scale.cwiseInverse().asDiagonal();
  return fit;
}

double rSquared(const Eigen::VectorXd& y, const Eigen::VectorXd& residual, int first, int step) {
  double mean = 0.0;
  int count = 0;
  for (Eigen::Index i = first; i < y.size(); i += step, ++count) mean += y[i];
  mean /= count;
  double total = 0.0, left = 0.0;
  for (Eigen::Index i = first; i < y.size(); i += step) {
    total += (y[i] - mean) * (y[i] - mean);
    left += residual[i] * residual[i];
  }
  return total > 0.0 ? 1.0 - left / total : NOT_KNOWN;
}

void checkFinite(double value, const char* what, std::size_t test) {
  if (std::isfinite(value)) return;
  throw Error("regression of coefficients: " + std::string(what) + " of test " + std::to_string(test + 1) +
              " is not a finite number");
}

}  // namespace

IdentifiedCoefficients identifyFromForces(const std::vector<MeanForceTest>& tests) {
  const Eigen::Index n = static_cast<Eigen::Index>(tests.size());
  Eigen::MatrixXd x(3 * n, 6);
  Eigen::VectorXd y(3 * n), sigma(3 * n);
  std::vector<int> group;
  std::vector<double> chips;
  for (std::size_t t = 0; t < tests.size(); ++t) {
    const auto matrix = meanForceMatrix(tests[t].tool, tests[t].engagement);
    chips.push_back(meanChip(matrix));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Eigen::Index row = static_cast<Eigen::Index>(3 * t + axis);
      for (std::size_t c = 0; c < 6; ++c) x(row, static_cast<Eigen::Index>(c)) = matrix[axis][c];
      checkFinite(tests[t].force[axis], "the mean force", t);
      checkFinite(tests[t].force_std[axis], "the standard deviation of the mean force", t);
      y[row] = tests[t].force[axis];
      sigma[row] = tests[t].force_std[axis];
      group.push_back(static_cast<int>(axis));
    }
  }
  if (differentChips(chips) < 2) {
    throw Error("coefficients from forces: " + std::to_string(tests.size()) + " tests at " +
                std::to_string(differentChips(chips)) + " feed; expected at least two different feeds");
  }
  const Fit fit = leastSquares(x, y, sigma, group);
  IdentifiedCoefficients result;
  result.tests = static_cast<int>(tests.size());
  result.covariance = fit.covariance;
  const auto values = inOrder(result.value), stds = inOrder(result.std_dev);
  for (std::size_t c = 0; c < 6; ++c) {
    const Eigen::Index i = static_cast<Eigen::Index>(c);
    *values[c] = fit.value[i];
    *stds[c] = std::sqrt(fit.covariance(i, i));
  }
  result.r_squared_x = rSquared(y, fit.residual, 0, 3);
  result.r_squared_y = rSquared(y, fit.residual, 1, 3);
  result.r_squared_z = rSquared(y, fit.residual, 2, 3);
  return result;
}

}  // namespace smartmill
