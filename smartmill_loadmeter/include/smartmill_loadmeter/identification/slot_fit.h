#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/identification/force_law.h"

namespace smartmill::loadmeter {

struct SlotFitOptions {
  double largest_offset = 6e-5;      ///< [m] bound: twice IdentificationParameters::largest_runout
  double largest_unbalance = 500.0;  ///< [N] bound, far above the force of a balanced holder
  double tolerance = 1e-7;           ///< [1] relative change of the squares at convergence
  /// [rad] bound of a cut's phase about that of the search or of the previous fit: less than a quarter of a
  /// pitch of three teeth, so that a fit does not move to another tooth.
  double phase_range = 0.5;
  /// [rad] directions of the offset from which the first fit with it starts, because a zero offset has none.
  std::vector<double> directions{0.5, 2.6};
};

/// Fit of whole revolutions of force by a rigid tool with runout and size effect, Kc (h / 0.1 mm)^-p.
struct SlotFitResult {
  std::string name;
  CuttingCoefficients value, std_dev;
  double size_exponent = 0.0, size_exponent_std = 0.0;  ///< [1]
  double offset = 0.0, offset_std = 0.0;                ///< [m] of the cutter axis
  double offset_angle = 0.0;                            ///< [rad] relative to tooth 1
  std::vector<double> phase;  ///< [rad] of each cut: spindle angle at its revolution's start
  double unbalance = 0.0;     ///< [N] force rotating with the tool
  double bic = 0.0;           ///< lower is better
  double rms = 0.0;           ///< [N] of the residual in the mean and the first orders
};

/// Fits the mean revolution of each cut of a campaign (fx, fy, fz at even angles, phases aligned by the fit)
/// with and without size effect, runout and unbalance, best first. Only the mean and the first teeth + 1
/// orders are compared, below the resonances of a force sensor. Without a tachometer the phase of each cut is
/// an unknown.
/// @throws Error with the file and what is missing.
std::vector<SlotFitResult> fitSlots(const Campaign& campaign, const MachineModel& model,
                                    const SlotFitOptions& options = {});

/// Force over chip thickness of all cuts in one list, from their mean revolutions at the phases of a fit.
/// @throws Error as forcePoints().
std::vector<ForcePoint> revolutionPoints(const Campaign& campaign, const MachineModel& model,
                                         const SlotFitResult& fit);

}  // namespace smartmill::loadmeter
