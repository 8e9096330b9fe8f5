#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/calibration/fit.h"
#include "smartmill_loadmeter/calibration/load_meter.h"

namespace smartmill::loadmeter {

/// Terms of a friction law in addition to viscous and Coulomb friction.
struct FrictionTerms {
  bool stribeck = false;
  bool warmup = false;

  std::size_t unknowns() const { return 2u + (stribeck ? 2u : 0u) + (warmup ? 2u : 0u); }
  std::string name() const;  ///< for example "Coulomb and viscous, Stribeck, warm-up"
};

/// Unknowns of a fit in the order viscous, coulomb, [breakaway, stribeck_speed], [cold_ratio, warmup_time].
std::vector<FitParameter> frictionParameters(const FrictionTerms& terms, double slowest, double fastest,
                                             const FrictionLaw& start);
FrictionLaw frictionLaw(const FrictionTerms& terms, const double* values, double zero_below);

/// Steady voltage of one air cut and its start time.
struct TimedAirCut {
  AirCut cut;
  double start_time = 0.0;  ///< [s] since the spindle started cold
};

/// Friction law fitted to air cuts.
struct FittedFriction {
  FrictionTerms terms;
  FrictionLaw law;
  std::vector<double> std_dev;     ///< of the unknowns
  std::vector<double> value;       ///< of the unknowns
  std::vector<double> covariance;  ///< of the unknowns, row by row
  double bic = 0.0;                ///< lower is better
  double rms = 0.0;                ///< [N m] RMS of the residual
};

/// Friction laws with every combination of terms for which there are at least one cut more than unknowns,
/// best first by the Bayesian information criterion. Each additional term must lower the criterion by 6
/// (strong evidence).
/// @throws Error with fewer than two speeds.
std::vector<FittedFriction> fitFrictionLaws(const std::vector<TimedAirCut>& air_cuts, double load_meter_gain,
                                            double zero_below);

}  // namespace smartmill::loadmeter
