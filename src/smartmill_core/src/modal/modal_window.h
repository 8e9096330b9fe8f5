#pragma once

#include <complex>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/modal/modal_poles.h"

namespace smartmill {

/// Logarithms of frequency [Hz] and damping ratio of each mode in turn.
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

/// What stands linearly in one FRF once the poles are given: of each mode gain and phase part,
/// (gain + i phase_part f / f_n) unitMode, and a complex parabola for all that lies outside the window.
struct WindowShares {
  Eigen::MatrixXd columns;  // 2 lines x shares, weighted; real and imaginary part of a line in turn
  Eigen::VectorXd share;    // [unit]
  Eigen::VectorXd left;     // weighted (measured - fitted)
  Eigen::MatrixXd inverse;  // of the normal equations
};

/// A fit over a few modes' lines, with what it proves.
struct WindowFit {
  PoleList poles;
  std::vector<WindowShares> frfs;
  double squares = 0.0;                     // of all that is left
  double alike = 1.0;                       // FRFs over those whose misfit tells something of its own
  Eigen::MatrixXd pole_covariance;          // for residuals of variance 1
  std::vector<Eigen::MatrixXd> covariance;  // of each FRF's shares, the poles' part included
  std::vector<double>
      variance;  // [1] of the misfit about each mode, times the lines over which it hangs together
  std::vector<double> evidence;  // of each mode: Wald's statistic over what chance gives at most

  Eigen::Index weakest() const;
};

/// Modes in a stretch of lines. Variable projection: the search goes over the poles alone.
class ModalWindow : public fit::Residuals {
 public:
  /// @param lines_searched how many lines could have shown a mode by chance
  ModalWindow(WeightedLines lines, bool real_modes, std::size_t lines_searched);

  Eigen::Index count() const override;
  bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

  Eigen::Index sharesPerMode() const { return real_modes_ ? 1 : 2; }
  const WeightedLines& lines() const { return lines_; }

  WindowShares shares(std::size_t frf, const PoleList& poles) const;
  /// Most that a chi-square shows by chance where so many shares stand for a mode.
  double limit(std::size_t shares) const;
  /// What one mode explains of the lines, over what chance gives; the misfit counted as noise without colour.
  double explained(double frequency, double damping) const;
  /// Poles where the misfit is least.
  PoleList refined(const PoleList& start, int iterations, double tolerance) const;
  WindowFit judged(const PoleList& poles) const;
  /// Takes the misfit into the weights where it is more than noise: repeatable, as large all over the
  /// window.
  /// @return whether weights changed
  bool addMisfit(const WindowFit& fit);

 private:
  Eigen::MatrixXd slopes(std::size_t frf, const PoleList& poles, const WindowShares& shares) const;
  double localVariance(const WindowFit& fit, Eigen::Index mode) const;
  double alike(const WindowFit& fit) const;
  double evidence(const WindowFit& fit, Eigen::Index mode) const;
  double apart(const WindowFit& fit, Eigen::Index mode) const;
  double onOneLine(const WindowFit& fit, Eigen::Index mode) const;

  WeightedLines lines_;
  bool real_modes_;
  double chance_;
  Eigen::MatrixXd background_;  // 2 lines x BACKGROUND, not weighted
};

}  // namespace smartmill
