#include "solvers/harmonic_balance.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/delayed_system.h"

namespace smartmill::stability {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using units::TWO_PI;

namespace {

/// Receptance of the system at w [rad/s], from its lines or its modes.
Eigen::Matrix2cd receptanceOf(const RegenerativeSystem& system, double w) {
  const auto g = system.response ? system.response->at(w / TWO_PI) : receptance(system.modes, w / TWO_PI);
  Eigen::Matrix2cd m;
  m << g[0], g[1], g[2], g[3];
  return m;
}

}  // namespace

Eigen::Matrix2cd Harmonics::at(int k, double w) const {
  const auto i = static_cast<std::size_t>(k + most);
  Eigen::Matrix2cd f = now[i] + Complex(0.0, w) * velocity[i];
  for (std::size_t d = 0; d < delays.size(); ++d) f += std::polar(1.0, -w * delays[d]) * delayed[i][d];
  return f;
}

Harmonics harmonicsOf(const RegenerativeSystem& system, double speed, int most, double depth) {
  const DelayedSystem unit = delayedSystem(system, speed, depth);
  Harmonics h;
  h.step = TWO_PI / unit.period;
  h.delays = unit.delays;
  h.most = most;
  const auto count = static_cast<std::size_t>(2 * most + 1);
  h.now.assign(count, Eigen::Matrix2cd::Zero());
  h.velocity = h.now;
  h.delayed.assign(count, std::vector<Eigen::Matrix2cd>(unit.delays.size(), Eigen::Matrix2cd::Zero()));
  std::vector<double> ends = unit.breaks;
  ends.push_back(0.0);
  ends.push_back(unit.period);
  std::sort(ends.begin(), ends.end());
  // Three-point Gauss quadrature on parts much shorter than the period of the highest harmonic.
  const double longest = unit.period / (12.0 * (most + 2));
  Feedback f;
  for (std::size_t e = 0; e + 1 < ends.size(); ++e) {
    const double length = ends[e + 1] - ends[e];
    if (length < 1e-10 * unit.period) continue;
    const int parts = static_cast<int>(std::ceil(length / longest));
    for (int p = 0; p < parts; ++p) {
      const double half = 0.5 * length / parts, middle = ends[e] + (2 * p + 1) * half;
      for (const auto& [x, w] : GAUSS) {
        const double t = middle + x * half, weight = w * half / unit.period / depth;
        unit.feedback(t, middle, f);
        for (int k = -most; k <= most; ++k) {
          const auto i = static_cast<std::size_t>(k + most);
          const Complex kernel = weight * std::polar(1.0, -k * h.step * t);
          h.now[i] += kernel * f.now;
          h.velocity[i] += kernel * f.velocity;
          for (std::size_t d = 0; d < f.delayed.size(); ++d) h.delayed[i][d] += kernel * f.delayed[d];
        }
      }
    }
  }
  return h;
}

Balance::Balance(const RegenerativeSystem& system, const Axes& axes, double speed, int below, int above,
                 double depth)
    : system_(system),
      axes_(axes),
      below_(below),
      above_(above),
      harmonics_(harmonicsOf(system, speed, below + above, depth)) {
}

MatrixXcd Balance::matrix(double w) const {
  const Index d = axes_.count(), n = (below_ + above_ + 1);
  MatrixXcd m(n * d, n * d);
  std::vector<Eigen::Matrix2cd> g;
  for (int r = -below_; r <= above_; ++r) g.push_back(receptanceOf(system_, w + r * harmonics_.step));
  for (Index r = 0; r < n; ++r) {
    for (Index l = 0; l < n; ++l) {
      const Eigen::Matrix2cd f =
          g[static_cast<std::size_t>(r)] *
          harmonics_.at(static_cast<int>(r - l), w + (static_cast<double>(l) - below_) * harmonics_.step);
      for (Index p = 0; p < d; ++p)
        for (Index q = 0; q < d; ++q)
          m(r * d + p, l * d + q) = f(static_cast<Index>(axes_.index[static_cast<std::size_t>(p)]),
                                      static_cast<Index>(axes_.index[static_cast<std::size_t>(q)]));
    }
  }
  return m;
}

std::vector<Complex> Balance::eigenvalues(double w, double least) const {
  std::vector<Complex> large;
  for (const Complex& value : linear::eigenvalues(matrix(w)))
    if (std::abs(value) > least) large.push_back(value);
  return large;
}

double Balance::strongest(double w, Complex value) const {
  MatrixXcd m = matrix(w);
  m.diagonal().array() -= value * (1.0 + 1e-10);
  const Eigen::PartialPivLU<MatrixXcd> lu(m);
  Eigen::VectorXcd u = Eigen::VectorXcd::Ones(m.rows());
  for (int i = 0; i < 3; ++i) u = lu.solve(u).normalized();
  const Index d = axes_.count();
  double best = -1.0, frequency = 0.0;
  for (Index r = 0; r * d < u.size(); ++r) {
    const double size = u.segment(r * d, d).norm();
    if (size > best) {
      best = size;
      frequency = std::abs(w + (static_cast<double>(r) - below_) * harmonics_.step) / TWO_PI;
    }
  }
  return frequency;
}

}  // namespace smartmill::stability
