#include "smartmill_kalman/sensor/state_space_checks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr double PRECISION = std::numeric_limits<double>::epsilon();

double infinityNorm(const MatrixXd& m) {
  return m.cwiseAbs().rowwise().sum().maxCoeff();
}

std::vector<double> multiply(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> product(a.size() + b.size() - 1, 0.0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) product[i + j] += a[i] * b[j];
  }
  return product;
}

}  // namespace

StateSpaceCheck checkStateSpace(const StateSpace& space, const std::string& form, double time) {
  const Index n = space.a.rows();
  StateSpaceCheck check;
  check.form = form;
  check.states = static_cast<int>(n);
  if (n == 0) return check;
  const MatrixXd a = time * space.a;
  // Also for nearly singular matrices. With a constant force as a state, A is singular.
  const MatrixXd inverse = linear::inverse(a);
  check.condition = inverse.allFinite() ? infinityNorm(a) * infinityNorm(inverse) : HUGE_VAL;
  check.conditioned = 1.0 / check.condition > PRECISION;

  const Eigen::VectorXcd poles = linear::eigenvalues(a);
  check.slowest = poles.real().maxCoeff() / time;
  check.stable = poles.real().maxCoeff() < 1e-9 * poles.cwiseAbs().maxCoeff();

  MatrixXd observability(n, n);
  Eigen::RowVectorXd row = space.c.row(0);
  for (Index i = 0; i < n; ++i) {
    observability.row(i) = row;
    row = row * a;
  }
  const Eigen::VectorXd values = linear::singularValues(observability);
  const double least = values(0) * PRECISION * static_cast<double>(n);
  check.rank = static_cast<int>((values.array() > least).count());
  check.observability_condition = values(n - 1) > 0.0 ? values(0) / values(n - 1) : HUGE_VAL;
  check.observable = check.rank == n && 1.0 / check.observability_condition > PRECISION;

  check.margin = HUGE_VAL;
  MatrixXcd test(n + 1, n);
  for (Index p = 0; p < n; ++p) {
    test.topRows(n) = (a.cast<Complex>() - poles(p) * MatrixXcd::Identity(n, n)) / a.norm();
    test.bottomRows(1) = (space.c.row(0) / space.c.row(0).norm()).cast<Complex>();
    check.margin = std::min(check.margin, linear::singularValues(test)(n - 1));
  }
  return check;
}

StateSpace companionForm(const ModalModel& model) {
  // Polynomials in s, highest power first: G = b / a.
  std::vector<double> a{1.0};
  for (const Mode& mode : model.modes) {
    const double w = units::TWO_PI * mode.frequency;
    a = multiply(a, {1.0, 2.0 * mode.damping_ratio * w, w * w});
  }
  std::vector<double> b(a.size(), 0.0);
  for (std::size_t i = 0; i < a.size(); ++i) b[i] = model.direct * a[i];
  for (std::size_t k = 0; k < model.modes.size(); ++k) {
    std::vector<double> rest{1.0};
    for (std::size_t o = 0; o < model.modes.size(); ++o) {
      if (o == k) continue;
      const double w = units::TWO_PI * model.modes[o].frequency;
      rest = multiply(rest, {1.0, 2.0 * model.modes[o].damping_ratio * w, w * w});
    }
    const double w = units::TWO_PI * model.modes[k].frequency;
    for (std::size_t i = 0; i < rest.size(); ++i)
      b[i + a.size() - rest.size()] += model.modes[k].gain * w * w * rest[i];
  }
  const auto n = static_cast<Index>(a.size() - 1);
  std::vector<double> beta(a.size());  // eq. 4-31
  for (std::size_t i = 0; i < a.size(); ++i) {
    beta[i] = b[i];
    for (std::size_t j = 1; j <= i; ++j) beta[i] -= a[j] * beta[i - j];
  }
  StateSpace space;
  space.a = MatrixXd::Zero(n, n);
  space.b = MatrixXd::Zero(n, 1);
  space.c = MatrixXd::Zero(1, n);
  space.d = MatrixXd::Constant(1, 1, beta[0]);
  for (Index i = 0; i < n; ++i) {
    if (i + 1 < n) space.a(i, i + 1) = 1.0;
    space.a(n - 1, i) = -a[static_cast<std::size_t>(n - i)];
    space.b(i, 0) = beta[static_cast<std::size_t>(i + 1)];
  }
  if (n > 0) space.c(0, 0) = 1.0;
  return space;
}

StateSpace withForce(const StateSpace& space) {
  const Index n = space.a.rows();
  StateSpace wider;
  wider.a = MatrixXd::Zero(n + 1, n + 1);
  wider.a.topLeftCorner(n, n) = space.a;
  wider.a.topRightCorner(n, 1) = space.b;
  wider.b = MatrixXd::Zero(n + 1, 1);
  wider.b(n, 0) = 1.0;
  wider.c = MatrixXd::Zero(1, n + 1);
  wider.c.leftCols(n) = space.c;
  wider.c(0, n) = space.d(0, 0);
  wider.d = MatrixXd::Zero(1, 1);
  return wider;
}

Balanced balance(const StateSpace& space, int states) {
  const Index n = space.a.rows();
  if (states < 0 || states > n)
    throw Error("balanced truncation: " + std::to_string(states) + " states of " + std::to_string(n));
  const linear::Eigensystem eigen = linear::eigensystem(space.a);
  if (!(eigen.values.real().maxCoeff() < 0.0))
    throw Error("balanced truncation: the state space is not stable");
  // Lyapunov equations in the coordinates of the poles.
  const MatrixXcd v = eigen.vectors, back = linear::inverse(v);
  const Eigen::VectorXcd& poles = eigen.values;
  const Eigen::VectorXcd b = back * space.b.col(0).cast<Complex>();
  const Eigen::RowVectorXcd c = space.c.row(0).cast<Complex>() * v;
  MatrixXcd reach(n, n), observe(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      reach(i, j) = -b(i) * std::conj(b(j)) / (poles(i) + std::conj(poles(j)));
      observe(i, j) = -std::conj(c(i)) * c(j) / (std::conj(poles(i)) + poles(j));
    }
  }
  const auto root = [n](const MatrixXd& gramian) {
    const auto s = linear::symmetricEigensystem(0.5 * (gramian + gramian.transpose()));
    return MatrixXd(s.vectors * s.values.cwiseMax(0.0).cwiseSqrt().asDiagonal());
  };
  const MatrixXd p = root((v * reach * v.adjoint()).real());
  const MatrixXd q = root((back.adjoint() * observe * back).real());
  const linear::Svd svd = linear::svd(q.transpose() * p);
  const Eigen::VectorXd& hankel = svd.values;

  Balanced balanced;
  balanced.hankel.assign(hankel.data(), hankel.data() + n);
  Index keep = states == 0 ? n : states;
  while (keep > 1 && !(hankel(keep - 1) > 1e-12 * hankel(0))) --keep;  // not observable or not controllable
  for (Index i = keep; i < n; ++i) balanced.bound += 2.0 * hankel(i);
  const Eigen::VectorXd scale = hankel.head(keep).cwiseSqrt().cwiseInverse();
  const MatrixXd t = p * svd.v.leftCols(keep) * scale.asDiagonal();
  const MatrixXd t_back = scale.asDiagonal() * svd.u.leftCols(keep).transpose() * q.transpose();
  balanced.space.a = t_back * space.a * t;
  balanced.space.b = t_back * space.b;
  balanced.space.c = space.c * t;
  balanced.space.d = space.d;
  return balanced;
}

Balanced balanceTo(const StateSpace& space, double tolerance) {
  const Balanced all = balance(space);
  double bound = 0.0;
  int keep = static_cast<int>(all.hankel.size());
  while (keep > 1 && bound + 2.0 * all.hankel[static_cast<std::size_t>(keep - 1)] < tolerance * all.hankel[0])
    bound += 2.0 * all.hankel[static_cast<std::size_t>(--keep)];
  return balance(space, keep);
}

Complex responseOf(const StateSpace& space, double f) {
  const Index n = space.a.rows();
  if (n == 0) return space.d(0, 0);
  const MatrixXcd system =
      Complex(0.0, units::TWO_PI * f) * MatrixXcd::Identity(n, n) - space.a.cast<Complex>();
  const MatrixXcd state = linear::solve(system, MatrixXcd(space.b.cast<Complex>()));
  return (space.c.cast<Complex>() * state)(0, 0) + space.d(0, 0);
}

std::vector<StateSpaceCheck> checkSensor(const ModalModel& sensor) {
  if (sensor.modes.empty()) return {};
  double mean = 0.0;  // of the modes' natural frequencies [rad/s], geometric
  for (const Mode& mode : sensor.modes) mean += std::log(units::TWO_PI * mode.frequency);
  const double time = std::exp(-mean / static_cast<double>(sensor.modes.size()));
  const StateSpace modal = stateSpace(sensor);
  const Balanced balanced = balance(modal);
  StateSpace counted = balanced.space;  // in the modes' unit of time also the force acts with size 1
  counted.a *= time;
  counted.b *= time;
  return {checkStateSpace(companionForm(sensor), "companion (4-33), seconds"),
          checkStateSpace(modal, "modal (5.18), seconds"),
          checkStateSpace(modal, "modal, modes' unit of time", time),
          checkStateSpace(balanced.space, "balanced, modes' unit of time", time),
          checkStateSpace(withForce(counted), "balanced with force (4-43)")};
}

}  // namespace smartmill::kalman
