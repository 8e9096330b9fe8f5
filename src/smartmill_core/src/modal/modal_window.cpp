#include "modal_window.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index POWERS = 3, BACKGROUND = 2 * POWERS;  // of the parabola: real and imaginary part

Eigen::Index at(std::size_t i) {
  return static_cast<Eigen::Index>(i);
}

}  // namespace

double PoleList::frequency(Index k) const {
  return std::exp(p[2 * k]);
}

double PoleList::damping(Index k) const {
  return std::exp(p[2 * k + 1]);
}

PoleList PoleList::with(double frequency, double damping) const {
  PoleList more{VectorXd(p.size() + 2)};
  more.p << p, std::log(frequency), std::log(damping);
  return more;
}

PoleList PoleList::without(Index k) const {
  PoleList less{VectorXd(p.size() - 2)};
  less.p << p.head(2 * k), p.tail(p.size() - 2 * k - 2);
  return less;
}

Complex unitMode(double f, double f0, double zeta) {
  const double r = f / f0, real = 1.0 - r * r, imag = 2.0 * zeta * r;
  const double size = 1.0 / (real * real + imag * imag);
  return {real * size, -imag * size};
}

ModalWindow::ModalWindow(WeightedLines lines, const ModalEstimateOptions& options, std::size_t lines_searched)
    : lines_(std::move(lines)),
      real_modes_(options.real_modes),
      more_than_noise_(options.search.more_than_noise),
      chance_(std::log(static_cast<double>(lines_searched) / options.search.chance)) {
  background_ = MatrixXd::Zero(at(2 * lines_.size()), BACKGROUND);
  const double middle = 0.5 * (lines_.frequency.front() + lines_.frequency.back());
  const double half = 0.5 * (lines_.frequency.back() - lines_.frequency.front());
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const double x = (lines_.frequency[i] - middle) / half;
    double power = 1.0;
    for (Index n = 0; n < POWERS; ++n, power *= x) {
      background_(at(2 * i), 2 * n) = power;
      background_(at(2 * i + 1), 2 * n + 1) = power;
    }
  }
}

Index ModalWindow::count() const {
  return at(2 * lines_.size() * lines_.frfs());
}

WindowShares ModalWindow::shares(std::size_t frf, const PoleList& poles) const {
  const Index m = poles.modes(), per = sharesPerMode(), rows = at(2 * lines_.size());
  WindowShares s;
  s.columns.resize(rows, m * per + BACKGROUND);
  VectorXd measured(rows);
  for (Index k = 0; k < m; ++k) {
    const double f0 = poles.frequency(k), zeta = poles.damping(k);
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const double f = lines_.frequency[i], w = lines_.weight[frf][i];
      const Complex u = w * unitMode(f, f0, zeta);
      s.columns(at(2 * i), k * per) = u.real();
      s.columns(at(2 * i + 1), k * per) = u.imag();
      if (per == 1) continue;
      s.columns(at(2 * i), k * per + 1) = -f / f0 * u.imag();
      s.columns(at(2 * i + 1), k * per + 1) = f / f0 * u.real();
    }
  }
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const double w = lines_.weight[frf][i];
    s.columns.block(at(2 * i), m * per, 2, BACKGROUND) = w * background_.middleRows(at(2 * i), 2);
    measured[at(2 * i)] = w * lines_.value[frf][i].real();
    measured[at(2 * i + 1)] = w * lines_.value[frf][i].imag();
  }
  const VectorXd size = s.columns.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  MatrixXd normal = size.asDiagonal() * (s.columns.transpose() * s.columns) * size.asDiagonal();
  normal.diagonal().array() += 1e-12;
  s.inverse = size.asDiagonal() * linear::inverseSymmetric(normal) * size.asDiagonal();
  s.share = s.inverse * (s.columns.transpose() * measured);
  s.residual = measured - s.columns * s.share;
  return s;
}

MatrixXd ModalWindow::slopes(std::size_t frf, const PoleList& poles, const WindowShares& shares) const {
  const Index m = poles.modes(), per = sharesPerMode();
  MatrixXd d(at(2 * lines_.size()), 2 * m);
  for (Index k = 0; k < m; ++k) {
    const double f0 = poles.frequency(k), zeta = poles.damping(k);
    const double gain = shares.share[k * per], part = per == 2 ? shares.share[k * per + 1] : 0.0;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const double w = lines_.weight[frf][i], r = lines_.frequency[i] / f0;
      const Complex u = unitMode(lines_.frequency[i], f0, zeta), numerator(gain, part * r);
      // du/dln f0 = -u^2 (2 r^2 - 2 i zeta r), du/dln zeta = -u^2 2 i zeta r, d(i r)/dln f0 = -i r
      const Complex by_frequency =
          -w * u * (numerator * u * Complex(2.0 * r * r, -2.0 * zeta * r) + Complex(0.0, part * r));
      const Complex by_damping = -w * numerator * u * u * Complex(0.0, 2.0 * zeta * r);
      d(at(2 * i), 2 * k) = by_frequency.real();
      d(at(2 * i + 1), 2 * k) = by_frequency.imag();
      d(at(2 * i), 2 * k + 1) = by_damping.real();
      d(at(2 * i + 1), 2 * k + 1) = by_damping.imag();
    }
  }
  return d;
}

bool ModalWindow::evaluate(const VectorXd& at_poles, VectorXd* residual, MatrixXd* jacobian) const {
  const Index rows = at(2 * lines_.size());
  const PoleList poles{at_poles};
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    const WindowShares s = shares(o, poles);
    if (!s.residual.allFinite()) return false;
    residual->segment(at(o) * rows, rows) = s.residual;
    if (!jacobian) continue;
    // Kaufman's approximation: neglects the change of the shares outside the span of the columns.
    const MatrixXd d = slopes(o, poles, s);
    jacobian->middleRows(at(o) * rows, rows) = s.columns * (s.inverse * (s.columns.transpose() * d)) - d;
  }
  return true;
}

double ModalWindow::limit(std::size_t shares) const {
  // Largest chi-square by chance (bound of Laurent and Massart, 2000); frequency and damping add two degrees
  // of freedom.
  const auto degrees = static_cast<double>(2 + shares);
  return degrees + 2.0 * std::sqrt(degrees * chance_) + 2.0 * chance_;
}

double ModalWindow::explained(double frequency, double damping) const {
  double with = 0.0, without = 0.0;
  const PoleList mode = PoleList().with(frequency, damping);
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    without += shares(o, PoleList()).residual.squaredNorm();
    with += shares(o, mode).residual.squaredNorm();
  }
  const double variance = std::max(with, 1e-30) / static_cast<double>(count());
  return (without - with) / variance / limit(static_cast<std::size_t>(sharesPerMode()) * lines_.frfs());
}

PoleList ModalWindow::refined(const PoleList& start, int iterations, double tolerance) const {
  std::vector<fit::Parameter> parameters(static_cast<std::size_t>(start.p.size()));
  for (Index k = 0; k < start.modes(); ++k) {
    const double f = start.p[2 * k], zeta = start.damping(k), margin = std::max(0.02, 2.0 * zeta);
    parameters[static_cast<std::size_t>(2 * k)] = {f, f - margin, f + margin, std::max(1e-5, 0.1 * zeta)};
    parameters[static_cast<std::size_t>(2 * k + 1)] = {start.p[2 * k + 1], std::log(MIN_DAMPING),
                                                       std::log(MAX_DAMPING), 0.1};
  }
  fit::Options options;
  options.name = "modes";
  options.iterations = iterations;
  options.function_tolerance = tolerance;
  options.parameter_tolerance = 1e-9;
  options.finish_at_bounds = false;
  const fit::Result found = fit::minimise(*this, parameters, options);
  return found.usable() ? PoleList{found.value} : start;
}

WindowFit ModalWindow::assess(const PoleList& poles) const {
  WindowFit f;
  f.poles = poles;
  const Index m = poles.modes();
  std::vector<MatrixXd> share_slopes;  // derivatives of the shares with respect to the poles
  MatrixXd information = MatrixXd::Zero(2 * m, 2 * m);
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    f.frfs.push_back(shares(o, poles));
    const WindowShares& s = f.frfs.back();
    f.squares += s.residual.squaredNorm();
    const MatrixXd d = slopes(o, poles, s), along = s.columns.transpose() * d;
    share_slopes.push_back(s.inverse * along);
    information += d.transpose() * d - along.transpose() * share_slopes.back();
  }
  if (m == 0) return f;
  const VectorXd size = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  MatrixXd scaled = size.asDiagonal() * information * size.asDiagonal();
  scaled.diagonal().array() += 1e-10;
  f.pole_covariance = size.asDiagonal() * linear::inverseSymmetric(scaled) * size.asDiagonal();
  for (std::size_t o = 0; o < lines_.frfs(); ++o)
    f.covariance.push_back(f.frfs[o].inverse +
                           share_slopes[o] * f.pole_covariance * share_slopes[o].transpose());
  f.redundancy = redundancy(f);
  for (Index k = 0; k < m; ++k) f.variance.push_back(localVariance(f, k));
  for (Index k = 0; k < m; ++k) f.evidence.push_back(evidence(f, k));
  return f;
}

// Variance of the misfit around a mode, including its correlation from line to line, which reduces the
// information.
double ModalWindow::localVariance(const WindowFit& fit, Index mode) const {
  const std::size_t n = lines_.size();
  const double f0 = fit.poles.frequency(mode),
               reach = std::max(fit.poles.halfWidth(mode), 3.0 * lines_.step());
  double power = 0.0, weight = 0.0, along = 0.0;
  for (const WindowShares& s : fit.frfs) {
    for (std::size_t i = 0; i < n; ++i) {
      const double far = (lines_.frequency[i] - f0) / reach, share = 1.0 / (1.0 + far * far / 9.0);
      const Index row = at(2 * i);
      power += share * (s.residual[row] * s.residual[row] + s.residual[row + 1] * s.residual[row + 1]);
      weight += 2.0 * share;
      if (i + 1 < n)
        along += share * (s.residual[row] * s.residual[row + 2] + s.residual[row + 1] * s.residual[row + 3]);
    }
  }
  const double numbers = static_cast<double>(2 * n * lines_.frfs());
  const double fitted =
      static_cast<double>(2 * fit.poles.modes() + at(lines_.frfs()) * fit.frfs[0].share.size());
  const double variance = power / weight * numbers / std::max(numbers - fitted, 0.1 * numbers);
  const double correlation = std::clamp(along / std::max(power, 1e-300), 0.0, 0.98);
  return std::max(variance, 1e-30) * (1.0 + correlation) / (1.0 - correlation) * fit.redundancy;
}

// Misfit common to all FRFs (for example a hammer's ripple) carries no more information than in one. Number
// of FRFs over their effective number, from the sum of the squared correlations of their misfits.
double ModalWindow::redundancy(const WindowFit& fit) const {
  const std::size_t n = lines_.frfs();
  double sum = 0.0;
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = 0; b < n; ++b) {
      const VectorXd &p = fit.frfs[a].residual, &q = fit.frfs[b].residual;
      Complex along;
      for (Index i = 0; i + 1 < p.size(); i += 2) along += Complex(p[i], -p[i + 1]) * Complex(q[i], q[i + 1]);
      sum += std::norm(along) / std::max(p.squaredNorm() * q.squaredNorm(), 1e-300);
    }
  }
  return std::max(1.0, sum / static_cast<double>(n));
}

// Share of a mode that the other modes cannot represent: near 0 where two coincide or cancel.
double ModalWindow::separability(const WindowFit& fit, Index mode) const {
  const Index per = sharesPerMode();
  const auto contribution = [&](const WindowShares& s, Index k) -> VectorXd {
    return s.columns.middleCols(k * per, per) * s.share.segment(k * per, per);
  };
  double least = 1.0;
  for (Index other = 0; other < fit.poles.modes(); ++other) {
    if (other == mode) continue;
    const double width = fit.poles.halfWidth(mode) + fit.poles.halfWidth(other);
    const double off = std::hypot(fit.poles.frequency(mode) - fit.poles.frequency(other),
                                  fit.poles.halfWidth(mode) - fit.poles.halfWidth(other));
    if (off >= width) continue;
    double both = 0.0, each = 0.0;
    for (const WindowShares& s : fit.frfs) {
      const VectorXd a = contribution(s, mode), b = contribution(s, other);
      both += (a + b).squaredNorm();
      each += a.squaredNorm() + b.squaredNorm();
    }
    least = std::min(least, std::min(1.0, both / each) * off * off / (width * width));
  }
  return least;
}

// Share of a mode in a single line, as with hum or a spike.
double ModalWindow::singleLineShare(const WindowFit& fit, Index mode) const {
  const Index per = sharesPerMode();
  double all = 0.0, largest = 0.0;
  VectorXd power = VectorXd::Zero(at(lines_.size()));
  for (const WindowShares& s : fit.frfs) {
    const VectorXd a = s.columns.middleCols(mode * per, per) * s.share.segment(mode * per, per);
    for (Index i = 0; i < power.size(); ++i) power[i] += a[2 * i] * a[2 * i] + a[2 * i + 1] * a[2 * i + 1];
  }
  all = power.sum();
  largest = power.maxCoeff();
  return all > 0.0 ? largest / all : 1.0;
}

double ModalWindow::evidence(const WindowFit& fit, Index mode) const {
  const Index per = sharesPerMode();
  double wald = 0.0;
  for (std::size_t o = 0; o < fit.frfs.size(); ++o) {
    const MatrixXd c = fit.covariance[o].block(mode * per, mode * per, per, per);
    const VectorXd x = fit.frfs[o].share.segment(mode * per, per);
    const double part = x.dot(linear::solve(c, x));
    if (std::isfinite(part)) wald += part;
  }
  wald *= separability(fit, mode) * (1.0 - singleLineShare(fit, mode)) /
          fit.variance[static_cast<std::size_t>(mode)];
  return wald / limit(static_cast<std::size_t>(per) * fit.frfs.size());
}

bool ModalWindow::addMisfit(const WindowFit& fit) {
  bool changed = false;
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    double misfit = 0.0, noise = 0.0;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const double square = lines_.weight[o][i] * lines_.weight[o][i];
      misfit += fit.frfs[o].residual.segment<2>(at(2 * i)).squaredNorm() / square;
      noise += 2.0 / square;
    }
    if (!(misfit > more_than_noise_ * noise) &&
        !(fit.frfs[o].residual.squaredNorm() > more_than_noise_ * static_cast<double>(2 * lines_.size())))
      continue;
    const double even = std::max(0.0, misfit - noise) / static_cast<double>(2 * lines_.size());
    for (double& w : lines_.weight[o]) w = 1.0 / std::sqrt(1.0 / (w * w) + even);
    changed = true;
  }
  return changed;
}

}  // namespace smartmill
