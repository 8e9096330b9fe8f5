#pragma once

#include <array>
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

/// Starting points of the nonlinear terms, which have local minima.
struct FrictionStarts {
  std::array<double, 2> stribeck_shares{{0.15, 0.4}};          ///< [1] Stribeck speed over the fastest
  std::array<double, 3> warmup_times{{150.0, 600.0, 2400.0}};  ///< [s] a factor of four apart
};

struct FrictionFitOptions {
  /// [1] by which each further term must lower the Bayesian information criterion: strong evidence (Kass and
  /// Raftery 1995), because a nonlinear term lowers it by chance more often than the criterion allows for.
  double strong_evidence = 6.0;
  FrictionStarts starts;
};

/// Friction laws with every combination of terms for which there are at least one cut more than unknowns,
/// best first by the Bayesian information criterion.
/// @throws Error with fewer than two speeds.
std::vector<FittedFriction> fitFrictionLaws(const std::vector<TimedAirCut>& air_cuts, double load_meter_gain,
                                            double zero_below, const FrictionFitOptions& options = {});

}  // namespace smartmill::loadmeter
