#pragma once

#include <cmath>
#include <complex>
#include <vector>

#include "modal_window.h"
#include "smartmill_core/fit/least_squares.h"

namespace smartmill {

/// Lines of a modal fit, their weights, and the free terms in addition to the modes.
struct ModalLines {
  std::vector<double> frequency;            // [Hz]
  std::vector<std::complex<double>> value;  // [unit]
  std::vector<double> weight;               // [1/unit] of the real and of the imaginary part
  double scale = 1.0;                       // [unit] of gains and direct share inside the solver
  bool weighted = false;
  bool unit_static_gain = false;
  bool direct = false;
  bool positive = false;
  double low = 0.0, high = 0.0;  // [Hz]

  std::size_t lines() const { return frequency.size(); }
  int parameters(int modes) const { return 3 * modes + (direct ? 2 : 0); }
  int linear(int modes) const { return modes + (direct ? 1 : 0); }  // of the parameters
  /// Frequency dependence of the direct share at f [Hz] by modes above the band: that of one mode at the last
  /// line's frequency over the root of `bend`; 0: constant.
  double bent(double f, double bend) const { return 1.0 / (1.0 - bend * std::pow(f / frequency.back(), 2)); }
  double reference() const;
};

/// Root mean square over neighbouring lines. Standard deviations from the scatter of a few hits are
/// themselves uncertain, and favour lines that agree by chance.
std::vector<double> smoothedDeviation(const std::vector<double>& deviation);

/// Weighted (fit - measured), real and imaginary part line by line, over log f0, log zeta, gain / scale of
/// each mode, then direct / scale and its bend.
class ModalResiduals : public fit::Residuals {
 public:
  /// @param lines must outlive this
  ModalResiduals(const ModalLines& lines, int modes) : lines_(lines), modes_(modes) {}

  Eigen::Index count() const override { return static_cast<Eigen::Index>(2 * lines_.lines()); }
  bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

 private:
  const ModalLines& lines_;
  int modes_;
};

}  // namespace smartmill
