#pragma once

#include <array>
#include <complex>
#include <functional>
#include <limits>
#include <vector>

#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill::stability {

/// Regenerative process: number of teeth, engagement and cutting coefficients.
struct RegenerativeProcess {
  int teeth = 0;              ///< 1..20, evenly spaced
  double entry = 0.0;         ///< [rad] immersion angle, clockwise from +y
  double exit = 0.0;          ///< [rad] > entry
  double kt = 0.0;            ///< [N/m2] tangential
  double radial_ratio = 0.0;  ///< [1] radial over tangential
  /// @throws Error naming the quantity.
  void validate() const;
};

/// Receptances of the tool tip on one frequency grid [Hz], [m/N].
struct ToolTipResponse {
  std::vector<double> frequency;
  std::vector<std::complex<double>> xx, yy;
  std::vector<std::complex<double>> xy, yx;  ///< x for a force in y and the reverse; empty: none
  /// xx, xy, yx, yy at any f [Hz]; negative f: conjugate. Below the lines: real part of the first line;
  /// above: mass line through the last.
  std::array<std::complex<double>, 4> at(double f) const;
};

/// Evaluated from modes at frequencies from low to high [Hz], dense around each mode.
ToolTipResponse responseOf(const ModalModel& x, const ModalModel& y, double low, double high,
                           std::size_t lines);
/// From measured FRFs; y is interpolated at the lines of x. @throws Error when a unit is not m/N or the bands
/// do not overlap.
ToolTipResponse responseOf(const FrequencyResponse& x, const FrequencyResponse& y);

/// Lines [Hz] dense about a mode: quantiles of a Cauchy distribution as wide as its resonance and wider, of
/// these the ones from 0.3 to 3 times its frequency. Ascending.
std::vector<double> linesAround(double frequency, double damping_ratio, int lines);

/// Mean directional coefficients a_xx, a_xy, a_yx, a_yy over a revolution times 2 pi / teeth, so that A_0 =
/// teeth / (2 pi) x these (Dunwoody eq. 6.3..6.9, where the second a_xx is a_yy), for [x, y] vibration of the
/// tool and forces on the tool.
std::array<double, 4> directionalCoefficients(const RegenerativeProcess& process);

/// Zero-order solution of Altintas and Budak (Dunwoody eq. 6.10..6.14): the lobes of both eigenvalues,
/// interpolated between the lines.
class ZeroOrderLobes {
 public:
  ZeroOrderLobes(const RegenerativeProcess& process, const ToolTipResponse& tool);

  /// At each speed the smallest depth over all lobes. @param speeds [rad/s] > 0, ascending
  StabilityLimit limit(const std::vector<double>& speeds) const;
  /// [m] Critical limit: below this depth every speed is stable; +inf without a limit.
  double absolute() const { return absolute_; }

 private:
  struct Segment {
    double w1, w2, phase1, phase2, depth1, depth2;  // [rad/s], [rad] w T modulo 2 pi, [m] at both ends
  };
  int teeth_;
  std::vector<Segment> segments_;
  double absolute_ = std::numeric_limits<double>::infinity();
};

/// ZeroOrderLobes::limit().
StabilityLimit zeroOrderLimit(const RegenerativeProcess& process, const ToolTipResponse& tool,
                              const std::vector<double>& speeds);

/// ZeroOrderLobes::absolute().
double absoluteDepthLimit(const RegenerativeProcess& process, const ToolTipResponse& tool);

}  // namespace smartmill::stability
