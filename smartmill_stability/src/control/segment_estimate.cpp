#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/control/turning_control.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using units::TWO_PI;

/// Windowed spectra of the blocks of a signal at selected lines.
class BlockSpectra {
 public:
  explicit BlockSpectra(const EstimatorParameters& p) : p_(p) {
    for (int i = 0; i < p.block; ++i) window_.push_back(0.54 - 0.46 * std::cos(TWO_PI * i / (p.block - 1)));
  }

  int count() const { return (p_.segment - p_.block) / (p_.block / 2) + 1; }

  double frequencyOf(int line) const { return line * p_.sample_rate / p_.block; }  ///< [Hz]

  void select(const std::vector<int>& lines) {
    kernel_.resize(p_.block, static_cast<Index>(2 * lines.size()));
    for (std::size_t l = 0; l < lines.size(); ++l) {
      for (int i = 0; i < p_.block; ++i) {
        const double angle = TWO_PI * std::fmod(static_cast<double>(lines[l]) * i, p_.block) / p_.block;
        kernel_(i, static_cast<Index>(2 * l)) = window_[static_cast<std::size_t>(i)] * std::cos(angle);
        kernel_(i, static_cast<Index>(2 * l + 1)) = -window_[static_cast<std::size_t>(i)] * std::sin(angle);
      }
    }
  }

  /// Real and imaginary parts, line by line, block after block.
  VectorXd spectra(const VectorXd& signal) const {
    VectorXd all(count() * kernel_.cols());
    for (int b = 0; b < count(); ++b)
      all.segment(b * kernel_.cols(), kernel_.cols()).noalias() =
          kernel_.transpose() * signal.segment(b * (p_.block / 2), p_.block);
    return all;
  }

 private:
  const EstimatorParameters& p_;
  std::vector<double> window_;
  MatrixXd kernel_;  // windowed Fourier kernel: cosine and sine of each line
};

/// Power of each line, summed over the blocks.
std::vector<double> powers(const VectorXd& spectra, int lines, int blocks) {
  std::vector<double> power(static_cast<std::size_t>(lines), 0.0);
  for (int b = 0; b < blocks; ++b)
    for (int l = 0; l < lines; ++l)
      power[static_cast<std::size_t>(l)] += spectra.segment<2>(2 * (b * lines + l)).squaredNorm();
  return power;
}

/// Fit of the spectra of the deflection by those of gain x model(chip) and of the free motion from the start
/// of the segment.
class SegmentFit {
 public:
  SegmentFit(const BlockSpectra& blocks, const VectorXd& chip, const VectorXd& deflection, double rate)
      : blocks_(blocks), chip_(chip), target_(blocks.spectra(deflection)), rate_(rate) {}

  /// Residual with the best values of the linear parameters (gain and initial state).
  VectorXd residual(double frequency, double damping) {
    const MatrixXd basis = basisOf(frequency, damping);
    linear_ = linear::solveSymmetric(basis.transpose() * basis, VectorXd(basis.transpose() * target_));
    return target_ - basis * linear_;
  }

  double gain() const { return linear_[0]; }

  MatrixXd basisOf(double frequency, double damping) const {
    const ModalModel one{{{frequency / TWO_PI, damping, 1.0}}, 0.0};
    ModalFilter filter(one, rate_, Hold::first_order);
    const Index n = chip_.size();
    MatrixXd signals(n, 3);
    const double wd = frequency * std::sqrt(1.0 - damping * damping);
    // Free motion: rotation and decay.
    const Complex rotation = std::polar(std::exp(-damping * frequency / rate_), wd / rate_);
    Complex state = 1.0;
    filter.reset(chip_[0]);
    for (Index i = 0; i < n; ++i) {
      signals(i, 0) = filter.step(chip_[i]);
      signals(i, 1) = state.real();
      signals(i, 2) = state.imag();
      state *= rotation;
    }
    MatrixXd basis(target_.size(), 3);
    for (Index k = 0; k < 3; ++k) basis.col(k) = blocks_.spectra(signals.col(k));
    return basis;
  }

  Index size() const { return target_.size(); }
  const VectorXd& linear() const { return linear_; }

 private:
  const BlockSpectra& blocks_;
  const VectorXd& chip_;
  VectorXd target_;
  double rate_;
  VectorXd linear_;
};

/// Lines of the spectra, those of the band first.
struct Lines {
  std::vector<int> all;
  int in_band = 0;
  std::vector<double> input, output;  // power of each line, summed over the blocks
  int strongest = 0;                  // in the band, by output
};

/// Lines of the band, and some above it for the noise floor.
Lines linesOf(const BlockSpectra& blocks, const EstimatorParameters& p) {
  Lines lines;
  for (int l = 1; l < p.block / 2; ++l) {
    const double f = blocks.frequencyOf(l);
    if (f < p.frequency_low) continue;
    if (f <= p.frequency_high) ++lines.in_band;
    if (f <= p.frequency_high || l % 6 == 0) lines.all.push_back(l);
  }
  return lines;
}

/// H1 estimate of each line.
void ratios(const BlockSpectra& blocks, const Lines& lines, const VectorXd& us, const VectorXd& ys,
            SegmentEstimate* result) {
  const int count = static_cast<int>(lines.all.size());
  for (int l = 0; l < lines.in_band; ++l) {
    Complex cross = 0.0;
    for (int b = 0; b < blocks.count(); ++b) {
      const Index i = 2 * (b * count + l);
      cross += std::conj(Complex(us[i], us[i + 1])) * Complex(ys[i], ys[i + 1]);
    }
    result->frequency.push_back(blocks.frequencyOf(lines.all[static_cast<std::size_t>(l)]));
    result->ratio.push_back(cross / lines.input[static_cast<std::size_t>(l)]);
  }
}

/// Lines of the band in which both signals exceed their noise floors.
std::vector<int> usedLines(Lines* lines, double least_signal) {
  const auto floorOf = [&](const std::vector<double>& values) {
    std::vector<double> high(values.begin() + lines->in_band, values.end());
    std::nth_element(high.begin(), high.begin() + static_cast<std::ptrdiff_t>(high.size() / 2), high.end());
    return high[high.size() / 2];
  };
  const double floor_u = floorOf(lines->input), floor_y = floorOf(lines->output);
  std::vector<int> used;
  for (int l = 0; l < lines->in_band; ++l) {
    const auto i = static_cast<std::size_t>(l);
    if (lines->input[i] > least_signal * floor_u && lines->output[i] > least_signal * floor_y)
      used.push_back(lines->all[i]);
    if (lines->output[i] > lines->output[static_cast<std::size_t>(lines->strongest)]) lines->strongest = l;
  }
  return used;
}

/// The given start, or the best of a grid around the strongest line [rad/s].
std::array<double, 2> startOf(SegmentFit* fit, const SecondOrder* start, double strongest) {
  if (start) return {start->frequency, start->damping_ratio};
  std::array<double, 2> best{strongest, 0.02};
  double least = std::numeric_limits<double>::infinity();
  for (int i = -12; i <= 8; ++i) {
    for (const double damping : {0.008, 0.02, 0.05}) {
      const double frequency = strongest * (1.0 + 0.0125 * i);
      const double squares = fit->residual(frequency, damping).squaredNorm();
      if (squares < least) least = squares, best = {frequency, damping};
    }
  }
  return best;
}

constexpr double MOST_DAMPING = 0.9, LEAST_DAMPING = 1e-6;

/// Least squares over the logarithms of frequency and damping. @return residual sum of squares
double refine(SegmentFit* fit, std::array<double, 2> start, SecondOrder* model) {
  const fit::FunctionResiduals residuals(fit->size(), [&](const VectorXd& x, VectorXd& residual) {
    residual = fit->residual(std::exp(x[0]), std::exp(x[1]));
  });
  const double frequency = std::log(start[0]), damping = std::log(start[1]);
  constexpr double FAR = 1.0, FREQUENCY_SCALE = 0.006, DAMPING_SCALE = 0.2;
  fit::Options options;
  options.name = "segment estimate";
  options.function_tolerance = 1e-9;
  const fit::Result found =
      fit::minimise(residuals,
                    {{frequency, frequency - FAR, frequency + FAR, FREQUENCY_SCALE},
                     {damping, std::log(LEAST_DAMPING), std::log(MOST_DAMPING), DAMPING_SCALE}},
                    options);
  model->frequency = std::exp(found.value[0]);
  model->damping_ratio = std::exp(found.value[1]);
  const double squares = fit->residual(model->frequency, model->damping_ratio).squaredNorm();
  model->gain = fit->gain();
  return squares;
}

/// Covariance of gain, frequency and damping; blocks overlap by half, so half of the residuals are
/// independent.
Eigen::Matrix3d covarianceOf(const SegmentFit& fit, const SecondOrder& model, double squares) {
  const VectorXd& linear = fit.linear();
  MatrixXd jacobian(fit.size(), 5);
  jacobian.rightCols(3) = fit.basisOf(model.frequency, model.damping_ratio);
  const VectorXd here = jacobian.rightCols(3) * linear;
  constexpr double STEP = 1e-4;
  jacobian.col(0) = (fit.basisOf(model.frequency * (1.0 + STEP), model.damping_ratio) * linear - here) /
                    (STEP * model.frequency);
  jacobian.col(1) = (fit.basisOf(model.frequency, model.damping_ratio * (1.0 + STEP)) * linear - here) /
                    (STEP * model.damping_ratio);
  const double freedom = std::max(1.0, 0.5 * static_cast<double>(fit.size()) - 5.0);
  const MatrixXd covariance = squares / freedom * fit::covarianceOf(jacobian).matrix;
  const std::array<Index, 3> order{{2, 0, 1}};
  Eigen::Matrix3d result;
  for (Index i = 0; i < 3; ++i)
    for (Index j = 0; j < 3; ++j)
      result(i, j) = covariance(order[static_cast<std::size_t>(i)], order[static_cast<std::size_t>(j)]);
  return result;
}

}  // namespace

SegmentEstimate estimateSegment(const std::vector<double>& chip, const std::vector<double>& deflection,
                                const EstimatorParameters& p, const SecondOrder* start) {
  if (static_cast<int>(chip.size()) != p.segment || static_cast<int>(deflection.size()) != p.segment)
    throw Error("segment estimate: " + std::to_string(chip.size()) + " samples of the chip thickness, " +
                std::to_string(deflection.size()) + " of the deflection: expected " +
                std::to_string(p.segment));
  if (p.block < 16 || p.block > p.segment)
    throw Error("segment estimate: block of " + std::to_string(p.block) + " samples: expected 16 to " +
                std::to_string(p.segment));
  const VectorXd u = Eigen::Map<const VectorXd>(chip.data(), p.segment);
  const VectorXd y = Eigen::Map<const VectorXd>(deflection.data(), p.segment);
  BlockSpectra blocks(p);
  Lines lines = linesOf(blocks, p);
  blocks.select(lines.all);
  const VectorXd us = blocks.spectra(u), ys = blocks.spectra(y);
  const int count = static_cast<int>(lines.all.size());
  lines.input = powers(us, count, blocks.count());
  lines.output = powers(ys, count, blocks.count());
  SegmentEstimate result;
  ratios(blocks, lines, us, ys, &result);
  std::vector<int> used = usedLines(&lines, p.least_signal);
  result.lines = static_cast<int>(used.size());
  // Five unknowns (gain, frequency, damping, initial state); two residuals for each line and block.
  constexpr int FEWEST = 3;
  if (result.lines < FEWEST) return result;
  // Lines far from the resonance add computing time, but no information.
  constexpr std::size_t MOST = 24;
  const int middle = lines.all[static_cast<std::size_t>(lines.strongest)];
  if (used.size() > MOST) {
    std::sort(used.begin(), used.end(),
              [&](int a, int b) { return std::abs(a - middle) < std::abs(b - middle); });
    used.resize(MOST);
  }
  blocks.select(used);
  SegmentFit fit(blocks, u, y, p.sample_rate);
  SecondOrder& model = result.model;
  const double squares = refine(&fit, startOf(&fit, start, TWO_PI * blocks.frequencyOf(middle)), &model);
  if (!(model.gain > 0.0)) return result;
  model.covariance = covarianceOf(fit, model, squares);
  result.informed = model.covariance.allFinite();
  return result;
}

}  // namespace smartmill::stability
