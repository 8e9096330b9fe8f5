#pragma once

#include <array>
#include <vector>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

/// Viscous and Coulomb friction of a spindle with its uncertainty.
struct Friction : LinearFriction {
  /// covariance of (viscous, coulomb), row by row
  std::array<double, 4> covariance{{0.0, 0.0, 0.0, 0.0}};
};

/// Steady load-meter voltage of one air cut.
struct AirCut {
  double speed = 0.0;        ///< [rad/s] > 0
  double voltage = 0.0;      ///< [V]
  double voltage_std = 0.0;  ///< [V] of the mean; zero for all cuts: unweighted fit
};

/// Fits V = K b omega^2 + K T_cf omega (eq. 3.6..3.8) to the air cuts at or above zero_below. The covariance
/// is scaled up when the scatter of three or more air cuts exceeds their standard deviations.
/// @param load_meter_gain K [V/W]. @param zero_below [rad/s].
/// @throws Error with fewer than two speeds.
Friction fitFriction(const std::vector<AirCut>& air_cuts, double load_meter_gain, double zero_below);

/// Friction of the model file; each term has the stated uncertainty as standard deviation.
Friction modelFriction(const Spindle& spindle, double uncertainty_percent);

/// Time constant [s] of a first-order lag of this bandwidth [Hz].
double timeConstant(double bandwidth);

/// Mean of load-meter readings and its standard deviation.
struct MeanVoltage {
  double mean = 0.0;     ///< [V]
  double std_dev = 0.0;  ///< [V] of the mean
};

/// @param readings [V], at least two.
/// @param interval [s] between readings.
/// @param time_constant [s] of the lag; readings closer together are correlated, so that their mean is
/// less certain.
/// @param resolution [V] of the readings; averaging does not reduce the rounding error unless noise spreads
/// the readings over several steps.
MeanVoltage meanVoltage(const std::vector<double>& readings, double interval, double time_constant,
                        double resolution);

}  // namespace smartmill::loadmeter
