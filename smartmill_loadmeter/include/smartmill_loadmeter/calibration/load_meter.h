#pragma once

#include <array>
#include <vector>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

/// Spindle friction T_f = viscous omega + coulomb, zero below a speed (Dunwoody eq. 3.3, 3.11).
struct Friction {
  double viscous = 0.0;     ///< [N m s/rad]
  double coulomb = 0.0;     ///< [N m] any sign
  double zero_below = 0.0;  ///< [rad/s]
  /// Covariance of (viscous, coulomb), row by row.
  std::array<double, 4> covariance{{0.0, 0.0, 0.0, 0.0}};

  double torque(double speed) const;                   ///< [N m] at speed [rad/s]
  std::array<double, 2> gradient(double speed) const;  ///< of torque() to (viscous, coulomb)
};

/// Load meter in one air cut: the steady voltage at a speed.
struct AirCut {
  double speed = 0.0;        ///< [rad/s] > 0
  double voltage = 0.0;      ///< [V]
  double voltage_std = 0.0;  ///< [V] of the mean; zero in all: unweighted
};

/// Fits V = K b omega^2 + K T_cf omega (eq. 3.6..3.8) to the air cuts at or above zero_below. The covariance
/// is scaled up where the scatter of three or more air cuts exceeds their standard deviations.
/// @param load_meter_gain K [V/W]. @param zero_below [rad/s].
/// @throws Error with fewer than two speeds.
Friction fitFriction(const std::vector<AirCut>& air_cuts, double load_meter_gain, double zero_below);

/// What the model file states, with its uncertainty as standard deviation of each term.
Friction modelFriction(const Spindle& spindle, double uncertainty_percent);

/// Time constant of a first-order lag of this bandwidth [Hz], in s.
double timeConstant(double bandwidth);

/// Mean of load-meter readings and its standard deviation.
struct MeanVoltage {
  double mean = 0.0;     ///< [V]
  double std_dev = 0.0;  ///< [V] of the mean
};

/// @param readings [V], at least two. @param interval [s] between readings. @param time_constant [s] of the
/// lag: readings nearer than that may be correlated, so the mean of n of them is worth fewer. @param
/// resolution [V] the readings are rounded to: when noise does not spread them over the steps, averaging does
/// not help against rounding.
MeanVoltage meanVoltage(const std::vector<double>& readings, double interval, double time_constant,
                        double resolution);

}  // namespace smartmill::loadmeter
