#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// Motor currents to forces: Cheng & Venuvinod, sections 7..9.

/// Approximation of a signal by Daubechies-5 wavelets without the `level` finest bands of detail
/// (dyadic; the signal is mirrored at its ends to a power of two). Level L retains frequencies below rate /
/// 2^(L+1).
/// @throws Error with fewer than 2^level samples.
std::vector<double> denoise(const std::vector<double>& signal, int level);

/// Coarsest level that does not attenuate a sine of this frequency, at most 10.
int levelFor(double frequency, double sample_rate);

/// Range (twice the amplitude) of one phase's current: the de-noised signal's sine. @param frequency [Hz] of
/// the phase. @param slip [1] largest relative increase of the frequency (induction motors under load).
/// @return [A].
/// @throws Error with less than two periods.
double phaseRange(const std::vector<double>& current, double sample_rate, double frequency,
                  double slip = 0.0);
/// The same with the fitted frequency and the standard deviation from the residual.
struct PhaseFitResult {
  Estimate range;          ///< [A]
  double frequency = 0.0;  ///< [Hz]
};
PhaseFitResult fitPhase(const std::vector<double>& current, double sample_rate, double frequency,
                        double slip = 0.0);

/// Straight line y = slope x + level with its covariance.
struct Line {
  Estimate slope, level;
  double covariance = 0.0;
  double scatter = 0.0;    ///< standard deviation about the line
  double r_squared = 0.0;  ///< [1]
  int count = 0;

  double at(double x) const { return slope.value * x + level.value; }
  /// Standard deviation of one new y at x.
  double stdAt(double x) const;
};

/// Feed drive (Table 1): F = m I + c over calibration cuts; c = -(W + R), m has the sign of W + R, negative
/// when the weight aids the motion more than friction opposes it. @throws Error with fewer than three cuts.
Line fitLine(const std::vector<double>& x, const std::vector<double>& y);

/// Spindle cut: rise of the phase range over air cutting and the cutting torque.
struct SpindleCut {
  double speed_rpm = 0.0;
  double rise = 0.0;    ///< [A] I - Ia > 0
  double torque = 0.0;  ///< [N m] T = Fy (r + ap / 2)
};

/// T = a(N) dI^b(N); a and b cubic polynomials in N, one pair below and one above base speed (Table 1, note
/// 1).
class TorquePowerLaw {
 public:
  /// The degree is lower when the cuts have fewer different speeds. @throws Error with fewer than three cuts
  /// on a side that has cuts.
  TorquePowerLaw(const std::vector<SpindleCut>& cuts, double base_speed_rpm);

  /// Polynomials in (N - middle) / span, lowest power first; N, middle, span in rpm.
  struct Side {
    std::vector<double> a, b;
    double middle = 0.0, span = 1.0;
  };
  /// From stored values. @param scatter [N m].
  TorquePowerLaw(std::optional<Side> below, std::optional<Side> above, double base_speed_rpm, double scatter)
      : base_(base_speed_rpm), sides_{std::move(below), std::move(above)}, scatter_(scatter) {}

  double torque(double speed_rpm, double rise) const;  ///< [N m]
  /// Standard deviation of one new torque [N m]: scatter about the law.
  double scatter() const { return scatter_; }
  double rSquared() const { return r_squared_; }  ///< [1] of the fitted cuts
  double baseSpeed() const { return base_; }      ///< [rpm]
  const std::optional<Side>& side(bool above) const { return sides_[above ? 1 : 0]; }

 private:
  static double evaluate(const Side& side, double speed_rpm, double rise);

  double base_;
  std::array<std::optional<Side>, 2> sides_;  // below and above base speed
  double scatter_ = 0.0, r_squared_ = 0.0;
};

}  // namespace smartmill::loadmeter
