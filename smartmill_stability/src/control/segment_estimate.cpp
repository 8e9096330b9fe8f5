#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/control/turning_control.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using units::TWO_PI;

/// Windowed spectra of the blocks of a signal at chosen lines.
class Blocks {
 public:
  explicit Blocks(const EstimatorParameters& p) : p_(p) {
    for (int i = 0; i < p.block; ++i) window_.push_back(0.54 - 0.46 * std::cos(TWO_PI * i / (p.block - 1)));
  }

  int count() const { return (p_.segment - p_.block) / (p_.block / 2) + 1; }

  /// [Hz]
  double frequencyOf(int line) const { return line * p_.sample_rate / p_.block; }

  void choose(const std::vector<int>& lines) {
    turns_.resize(p_.block, static_cast<Index>(2 * lines.size()));
    for (std::size_t l = 0; l < lines.size(); ++l) {
      for (int i = 0; i < p_.block; ++i) {
        const double angle = TWO_PI * std::fmod(static_cast<double>(lines[l]) * i, p_.block) / p_.block;
        turns_(i, static_cast<Index>(2 * l)) = window_[static_cast<std::size_t>(i)] * std::cos(angle);
        turns_(i, static_cast<Index>(2 * l + 1)) = -window_[static_cast<std::size_t>(i)] * std::sin(angle);
      }
    }
  }

  /// Real and imaginary parts, line by line, block after block.
  VectorXd spectra(const VectorXd& signal) const {
    VectorXd all(count() * turns_.cols());
    for (int b = 0; b < count(); ++b)
      all.segment(b * turns_.cols(), turns_.cols()).noalias() =
          turns_.transpose() * signal.segment(b * (p_.block / 2), p_.block);
    return all;
  }

 private:
  const EstimatorParameters& p_;
  std::vector<double> window_;
  MatrixXd turns_;
};

/// Power of each line, summed over the blocks.
std::vector<double> powers(const VectorXd& spectra, int lines, int blocks) {
  std::vector<double> power(static_cast<std::size_t>(lines), 0.0);
  for (int b = 0; b < blocks; ++b)
    for (int l = 0; l < lines; ++l)
      power[static_cast<std::size_t>(l)] += spectra.segment<2>(2 * (b * lines + l)).squaredNorm();
  return power;
}

/// Fit of deflection spectra by those of gain x model(chip) and of free motion from the segment's begin.
class Fit {
 public:
  Fit(const Blocks& blocks, const VectorXd& chip, const VectorXd& deflection, double rate)
      : blocks_(blocks), chip_(chip), target_(blocks.spectra(deflection)), rate_(rate) {}

  /// Sum of squares left after the linear parameters (gain and the state at the begin) took their best
  /// values.
  double cost(double frequency, double damping) {
    const MatrixXd basis = basisOf(frequency, damping);
    linear_ = (basis.transpose() * basis).ldlt().solve(basis.transpose() * target_);
    return (target_ - basis * linear_).squaredNorm();
  }

  double gain() const { return linear_[0]; }

  MatrixXd basisOf(double frequency, double damping) const {
    const ModalModel one{{{frequency / TWO_PI, damping, 1.0}}, 0.0};
    ModalFilter filter(one, rate_, Hold::first_order);
    const Index n = chip_.size();
    MatrixXd signals(n, 3);
    const double wd = frequency * std::sqrt(1.0 - damping * damping);
    // Free motion by rotation and decay.
    const Complex turn = std::polar(std::exp(-damping * frequency / rate_), wd / rate_);
    Complex state = 1.0;
    filter.reset(chip_[0]);
    for (Index i = 0; i < n; ++i) {
      signals(i, 0) = filter.step(chip_[i]);
      signals(i, 1) = state.real();
      signals(i, 2) = state.imag();
      state *= turn;
    }
    MatrixXd basis(target_.size(), 3);
    for (Index k = 0; k < 3; ++k) basis.col(k) = blocks_.spectra(signals.col(k));
    return basis;
  }

  Index size() const { return target_.size(); }
  const VectorXd& linear() const { return linear_; }

 private:
  const Blocks& blocks_;
  const VectorXd& chip_;
  VectorXd target_;
  double rate_;
  VectorXd linear_;
};

/// Minimum over two parameters (Nelder and Mead), from a simplex of the step given.
Eigen::Vector2d minimum(const std::function<double(const Eigen::Vector2d&)>& cost,
                        const Eigen::Vector2d& start, const Eigen::Vector2d& step) {
  std::array<Eigen::Vector2d, 3> p{
      {start, start + Eigen::Vector2d(step[0], 0.0), start + Eigen::Vector2d(0.0, step[1])}};
  std::array<double, 3> f{{cost(p[0]), cost(p[1]), cost(p[2])}};
  constexpr int MOST = 80;
  for (int i = 0; i < MOST; ++i) {
    std::array<std::size_t, 3> order{{0, 1, 2}};
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return f[a] < f[b]; });
    const auto [best, middle, worst] = order;
    if ((p[worst] - p[best]).cwiseAbs().maxCoeff() < 1e-5 &&
        (p[middle] - p[best]).cwiseAbs().maxCoeff() < 1e-5)
      break;
    const Eigen::Vector2d centre = 0.5 * (p[best] + p[middle]);
    const auto along = [&](double t) { return Eigen::Vector2d(centre + t * (p[worst] - centre)); };
    const Eigen::Vector2d reflected = along(-1.0);
    const double fr = cost(reflected);
    if (fr < f[best]) {
      const Eigen::Vector2d further = along(-2.0);
      const double fe = cost(further);
      p[worst] = fe < fr ? further : reflected;
      f[worst] = std::min(fe, fr);
    } else if (fr < f[middle]) {
      p[worst] = reflected;
      f[worst] = fr;
    } else {
      const Eigen::Vector2d nearer = along(fr < f[worst] ? -0.5 : 0.5);
      const double fc = cost(nearer);
      if (fc < std::min(fr, f[worst])) {
        p[worst] = nearer;
        f[worst] = fc;
      } else {
        for (const std::size_t k : {middle, worst}) {
          p[k] = 0.5 * (p[k] + p[best]);
          f[k] = cost(p[k]);
        }
      }
    }
  }
  return p[static_cast<std::size_t>(std::min_element(f.begin(), f.end()) - f.begin())];
}

}  // namespace

SegmentEstimate estimateSegment(const std::vector<double>& chip, const std::vector<double>& deflection,
                                const EstimatorParameters& p, const SecondOrder* start) {
  if (static_cast<int>(chip.size()) != p.segment || static_cast<int>(deflection.size()) != p.segment)
    throw Error("segment estimate: " + std::to_string(chip.size()) + " and " +
                std::to_string(deflection.size()) + " samples, " + std::to_string(p.segment) + " are due");
  if (p.block < 16 || p.block > p.segment) throw Error("segment estimate: block " + std::to_string(p.block));
  const VectorXd u = Eigen::Map<const VectorXd>(chip.data(), p.segment);
  const VectorXd y = Eigen::Map<const VectorXd>(deflection.data(), p.segment);
  Blocks blocks(p);
  std::vector<int> all;
  int in_band = 0;
  for (int l = 1; l < p.block / 2; ++l) {
    const double f = blocks.frequencyOf(l);
    if (f < p.frequency_low) continue;
    if (f <= p.frequency_high) {
      all.push_back(l);
      ++in_band;
    } else if (l % 6 == 0) {
      all.push_back(l);  // of the floor
    }
  }
  blocks.choose(all);
  const VectorXd us = blocks.spectra(u), ys = blocks.spectra(y);
  const int count = static_cast<int>(all.size());
  const std::vector<double> power = powers(us, count, blocks.count()),
                            answer = powers(ys, count, blocks.count());
  SegmentEstimate result;
  // H1 line by line.
  for (int l = 0; l < in_band; ++l) {
    Complex cross = 0.0;
    for (int b = 0; b < blocks.count(); ++b) {
      const Index i = 2 * (b * count + l);
      cross += std::conj(Complex(us[i], us[i + 1])) * Complex(ys[i], ys[i + 1]);
    }
    result.frequency.push_back(blocks.frequencyOf(all[static_cast<std::size_t>(l)]));
    result.ratio.push_back(cross / power[static_cast<std::size_t>(l)]);
  }
  const auto floorOf = [&](const std::vector<double>& values) {
    std::vector<double> high(values.begin() + in_band, values.end());
    std::nth_element(high.begin(), high.begin() + static_cast<std::ptrdiff_t>(high.size() / 2), high.end());
    return high[high.size() / 2];
  };
  const double floor_u = floorOf(power), floor_y = floorOf(answer);
  std::vector<int> used;
  int strongest = 0;
  for (int l = 0; l < in_band; ++l) {
    const auto i = static_cast<std::size_t>(l);
    if (power[i] > p.least_signal * floor_u && answer[i] > p.least_signal * floor_y) used.push_back(all[i]);
    if (answer[i] > answer[static_cast<std::size_t>(strongest)]) strongest = l;
  }
  result.lines = static_cast<int>(used.size());
  // Gain, frequency, damping and the state at the begin: five numbers, two a line and block.
  constexpr int FEWEST = 3;
  if (result.lines < FEWEST) return result;
  // The strongest tell all; more lines cost time alone.
  constexpr std::size_t MOST = 24;
  if (used.size() > MOST) {
    const int middle = all[static_cast<std::size_t>(strongest)];
    std::sort(used.begin(), used.end(),
              [&](int a, int b) { return std::abs(a - middle) < std::abs(b - middle); });
    used.resize(MOST);
  }
  blocks.choose(used);
  Fit fit(blocks, u, y, p.sample_rate);
  // Over the logarithms of frequency and damping.
  const auto cost = [&](const Eigen::Vector2d& x) {
    const double damping = std::exp(x[1]);
    return damping < 0.9 ? fit.cost(std::exp(x[0]), damping) : 1e300;
  };
  Eigen::Vector2d best = Eigen::Vector2d::Zero();
  double least = 1e300;
  const auto consider = [&](double frequency, double damping) {
    const Eigen::Vector2d x(std::log(frequency), std::log(damping));
    const double c = cost(x);
    if (c < least) {
      least = c;
      best = x;
    }
  };
  if (start) {
    consider(start->frequency, start->damping_ratio);
  } else {
    const double at = TWO_PI * blocks.frequencyOf(all[static_cast<std::size_t>(strongest)]);
    for (int i = -12; i <= 8; ++i)
      for (const double damping : {0.008, 0.02, 0.05}) consider(at * (1.0 + 0.0125 * i), damping);
  }
  best = minimum(cost, best, {0.006, 0.2});
  SecondOrder& model = result.model;
  const double rest = cost(best);
  model.frequency = std::exp(best[0]);
  model.damping_ratio = std::exp(best[1]);
  model.gain = fit.gain();
  if (!(model.gain > 0.0)) return result;
  // Covariance from the derivatives; blocks overlap by half, so half of the residuals count.
  const VectorXd linear = fit.linear();
  const VectorXd here = fit.basisOf(model.frequency, model.damping_ratio) * linear;
  MatrixXd jacobian(fit.size(), 5);
  jacobian.rightCols(3) = fit.basisOf(model.frequency, model.damping_ratio);
  constexpr double STEP = 1e-4;
  jacobian.col(0) = (fit.basisOf(model.frequency * (1.0 + STEP), model.damping_ratio) * linear - here) /
                    (STEP * model.frequency);
  jacobian.col(1) = (fit.basisOf(model.frequency, model.damping_ratio * (1.0 + STEP)) * linear - here) /
                    (STEP * model.damping_ratio);
  const double freedom = std::max(1.0, 0.5 * static_cast<double>(fit.size()) - 5.0);
  // Scaled columns keep the inverse well conditioned.
  const VectorXd scale = jacobian.colwise().norm().cwiseMax(1e-300);
  const MatrixXd unit = jacobian * scale.cwiseInverse().asDiagonal();
  const MatrixXd covariance = rest / freedom *
                              (scale.cwiseInverse().asDiagonal() * (unit.transpose() * unit).inverse() *
                               scale.cwiseInverse().asDiagonal());
  const std::array<Index, 3> order{{2, 0, 1}};  // gain, frequency, damping
  for (Index i = 0; i < 3; ++i)
    for (Index j = 0; j < 3; ++j)
      model.covariance(i, j) =
          covariance(order[static_cast<std::size_t>(i)], order[static_cast<std::size_t>(j)]);
  result.informed = model.covariance.allFinite();
  return result;
}

}  // namespace smartmill::stability
