#pragma once

#include <vector>

#include "smartmill_core/fit/least_squares.h"

namespace smartmill::kalman {

/// Powers of lines that contain only noise through a resonance.
struct PowerLines {
  std::vector<double> frequency, power;  // [Hz], [any]
  double mean() const;
};

/// Power gain of a resonance, 1 at 0 Hz.
double resonance(double f, double f0, double zeta);

/// Expected power of a line, with derivatives by log f0, log zeta, gain and floor (over `unit`).
struct ExpectedPower {
  double value = 0.0;
  double slope[4] = {};
};
ExpectedPower expectedPower(double f, const Eigen::VectorXd& at, double unit);

/// Deviance residuals of an exponentially distributed spectrum over log f0, log zeta, gain and floor (over
/// the mean power): half the sum of their squares is minus the log-likelihood up to a constant, so that least
/// squares find its maximum.
class BlindResiduals : public fit::Residuals {
 public:
  /// The lines must outlive this.
  explicit BlindResiduals(const PowerLines& lines) : lines_(lines), unit_(lines.mean()) {}

  double unit() const { return unit_; }
  Eigen::Index count() const override { return static_cast<Eigen::Index>(lines_.power.size()); }
  bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

 private:
  const PowerLines& lines_;
  double unit_;
};

}  // namespace smartmill::kalman
