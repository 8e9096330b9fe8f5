#pragma once

#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// [N/m2] Share of a force law's answer in step with a chip that swings by `swing` about `chip`, over the
/// swing (first harmonic, the tool out of the work where the chip is below 0); swing 0: the slope.
double swingGain(const ForceCurve& law, double chip, double swing);

/// [m] mean over the arc of the chip of a feed per tooth; turning: the feed.
double meanChip(const RegenerativeSystem& system, double feed);

/// Limits at one speed. Above `small` the least vibration grows: gains are the law's slopes at the chip of
/// each angle. Above `large` a vibration that reaches the surface holds itself (swing the chip there, or the
/// share of it whose gain is greatest). Between them both states live side by side: a still cut stays still
/// until something kicks it (Bachrathy and Stepan's reference 9; the bistable range begins where the
/// vibration begins to leave the cut). The secant's gain F(h) / h, greater still where the law bends down,
/// bounds it from below.
struct BistableLimit {
  double speed = 0.0;  ///< [rad/s]
  Limit small, large;
  Limit secant;
};

/// @param system whose kt and kr the law replaces. @param feed [m] per tooth. @param max_depth [m]
/// Beyond the law's thickest chip it goes straight on. @throws Error when the feed lies outside the law or
/// the law does not rise there.
std::vector<BistableLimit> bistableLimits(const RegenerativeSystem& system, const ForceCurves& law,
                                          double feed, Method method, const SolverOptions& options,
                                          const std::vector<double>& speeds, double max_depth);

}  // namespace smartmill::stability
