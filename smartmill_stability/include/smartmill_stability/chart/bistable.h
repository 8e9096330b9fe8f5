#pragma once

#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// [N/m2] Describing function of a force law: first harmonic of the force in phase with a chip thickness that
/// oscillates with `amplitude` about `chip`, divided by the amplitude. The force is 0 where the chip
/// thickness is negative. Amplitude 0: the slope.
double describingFunction(const ForceCurve& law, double chip, double amplitude);

/// [m] Mean chip thickness over the arc for a feed per tooth [m]; turning: the feed.
double meanChip(const RegenerativeSystem& system, double feed);

/// Limits at one speed. Above `small` an infinitesimal vibration grows: the gains are the slopes of the law
/// at the chip thickness of each angle. Above `large` a vibration that reaches the surface persists: the
/// gains are describing functions with the chip thickness as amplitude, or the fraction of it with the
/// largest gain. Between the two is the bistable zone: a cut without vibration stays stable until it is
/// disturbed (Bachrathy and Stepan, reference 9; the zone begins where the vibration starts to leave the
/// cut). The secant gain F(h) / h, larger still for a concave law, bounds the zone from below.
struct BistableLimit {
  double speed = 0.0;  ///< [rad/s]
  Limit small, large;
  Limit secant;
};

/// The law is extrapolated linearly beyond its largest chip thickness.
/// @param system its kt and kr are replaced by the law. @param feed [m] per tooth. @param max_depth [m]
/// @throws Error when the feed lies outside the law, or the law does not rise at the mean chip thickness.
std::vector<BistableLimit> bistableLimits(const RegenerativeSystem& system, const ForceCurves& law,
                                          double feed, Method method, const SolverOptions& options,
                                          const std::vector<double>& speeds, double max_depth);

}  // namespace smartmill::stability
