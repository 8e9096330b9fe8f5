#pragma once

#include <complex>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_core/modal/modal_poles.h"

namespace smartmill {

/// Bounds of damping ratios in fits: a perfect spring and a hardly oscillating mode.
constexpr double MIN_DAMPING = 1e-6, MAX_DAMPING = 0.5;

/// Logarithms of frequency [Hz] and damping ratio of each mode.
struct PoleList {
  Eigen::VectorXd p = Eigen::VectorXd(0);

  Eigen::Index modes() const { return p.size() / 2; }
  double frequency(Eigen::Index k) const;
  double damping(Eigen::Index k) const;
  double halfWidth(Eigen::Index k) const { return frequency(k) * damping(k); }
  PoleList with(double frequency, double damping) const;
  PoleList without(Eigen::Index k) const;
};

/// f_n^2 / (f_n^2 - f^2 + 2 i zeta f_n f)
std::complex<double> unitMode(double f, double f0, double zeta);

/// Linear parameters of one FRF for given poles: gain and phase part of each mode, (gain + i phase_part f /
/// f_n) unitMode, and a complex parabola as background of everything outside the window.
struct WindowShares {
  Eigen::MatrixXd columns;   // 2 lines x shares, weighted; real and imaginary part of each line
  Eigen::VectorXd share;     // [unit]
  Eigen::VectorXd residual;  // weighted (measured - fitted)
  Eigen::MatrixXd inverse;   // of the normal equations
};

/// A fit over the lines of a few modes, with their evidence.
struct WindowFit {
  PoleList poles;
  std::vector<WindowShares> frfs;
  double squares = 0.0;                     // sum of squared residuals
  double redundancy = 1.0;                  // number of FRFs over the effective number of independent ones
  Eigen::MatrixXd pole_covariance;          // for residuals of variance 1
  std::vector<Eigen::MatrixXd> covariance;  // of each FRF's shares, including the contribution of the poles
  std::vector<double> variance;  // [1] of the misfit around each mode, times the number of correlated lines
  std::vector<double> evidence;  // of each mode: Wald statistic over its largest value by chance
};

/// Modes in an interval of lines, by variable projection: the search is over the poles only.
class ModalWindow : public fit::Residuals {
 public:
  /// @param lines_searched number of lines that could show a mode by chance
  ModalWindow(WeightedLines lines, const ModalEstimateOptions& options, std::size_t lines_searched);

  Eigen::Index count() const override;
  bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

  Eigen::Index sharesPerMode() const { return real_modes_ ? 1 : 2; }
  const WeightedLines& lines() const { return lines_; }

  WindowShares shares(std::size_t frf, const PoleList& poles) const;
  /// Largest chi-square by chance of a mode with this number of shares.
  double limit(std::size_t shares) const;
  /// Share of the lines that one mode explains, over its largest value by chance, with the misfit as white
  /// noise.
  double explained(double frequency, double damping) const;
  /// Poles of least misfit.
  PoleList refined(const PoleList& start, int iterations, double tolerance) const;
  WindowFit assess(const PoleList& poles) const;
  /// Includes the misfit in the weights where it exceeds the noise, as repeatable misfit of uniform size in
  /// the window.
  /// @return whether weights changed
  bool addMisfit(const WindowFit& fit);

 private:
  Eigen::MatrixXd slopes(std::size_t frf, const PoleList& poles, const WindowShares& shares) const;
  double localVariance(const WindowFit& fit, Eigen::Index mode) const;
  double redundancy(const WindowFit& fit) const;
  double evidence(const WindowFit& fit, Eigen::Index mode) const;
  double separability(const WindowFit& fit, Eigen::Index mode) const;
  double singleLineShare(const WindowFit& fit, Eigen::Index mode) const;

  WeightedLines lines_;
  bool real_modes_;
  double more_than_noise_, chance_;
  Eigen::MatrixXd background_;  // 2 lines x BACKGROUND, not weighted
};

}  // namespace smartmill
