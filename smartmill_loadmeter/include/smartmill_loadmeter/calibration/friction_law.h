#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/calibration/fit.h"
#include "smartmill_loadmeter/calibration/load_meter.h"

namespace smartmill::loadmeter {

/// Which terms a friction law has beyond viscous and Coulomb.
struct FrictionShape {
  bool stribeck = false;
  bool warmup = false;

  std::size_t unknowns() const { return 2u + (stribeck ? 2u : 0u) + (warmup ? 2u : 0u); }
  std::string name() const;  ///< e.g. "Coulomb and viscous, Stribeck, warm-up"
};

/// Spindle friction
///   T_f = [viscous w + coulomb + breakaway exp(-(w / stribeck_speed)^2)] (1 + cold_ratio exp(-t /
///   warmup_time)),
/// zero below a speed; t since the start of the campaign (effects.md: stribeck_friction, friction_warmup).
struct FrictionLaw {
  double viscous = 0.0;         ///< [N m s/rad]
  double coulomb = 0.0;         ///< [N m]
  double breakaway = 0.0;       ///< [N m]
  double stribeck_speed = 1.0;  ///< [rad/s] > 0
  double cold_ratio = 0.0;      ///< [1]
  double warmup_time = 1.0;     ///< [s] > 0
  double zero_below = 0.0;      ///< [rad/s]

  double torque(double speed, double start_time) const;  ///< [N m]

  /// Unknowns of a shape in fixed order: viscous, coulomb, [breakaway, stribeck_speed], [cold_ratio,
  /// warmup_time]; for a fit.
  static std::vector<FitParameter> parameters(const FrictionShape& shape, double slowest, double fastest,
                                              const FrictionLaw& start);
  static FrictionLaw fromValues(const FrictionShape& shape, const double* values, double zero_below);
};

/// Steady voltage of one air cut, and when it ran.
struct TimedAirCut {
  AirCut cut;
  double start_time = 0.0;  ///< [s] since the spindle started cold
};

/// A law fitted to air cuts.
struct FittedFriction {
  FrictionShape shape;
  FrictionLaw law;
  std::vector<double> std_dev;     ///< of the unknowns of the shape
  std::vector<double> value;       ///< of the unknowns
  std::vector<double> covariance;  ///< of the unknowns, row by row
  double bic = 0.0;                ///< lower is better
  double rms = 0.0;                ///< [N m] of what is left
};

/// All shapes the air cuts can carry (more cuts than unknowns), best first by the Bayesian information
/// criterion, each further term to win by 6 (strong evidence). Each has at least one cut more than unknowns.
/// @throws Error with fewer than two speeds.
std::vector<FittedFriction> fitFrictionLaws(const std::vector<TimedAirCut>& air_cuts, double load_meter_gain,
                                            double zero_below);

}  // namespace smartmill::loadmeter
