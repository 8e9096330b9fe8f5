#pragma once

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// [m] by which forced vibration widens a full slot, mean over its depth. The tool vibrates across the feed
/// by y(t) = G * Fy in steady state; the walls are where a tooth passes 0 and pi:
///
///     widening = y(tooth at 0) - y(tooth at pi)
///
/// (surface location error, Schmitz & Ziegert 1999). Teeth are evenly spaced, so that forced vibration does
/// not change the chip; runout, chatter and feed marks are not included. With an even number of teeth both
/// walls shift equally and the widening is zero.
/// @param force_uncertainty [1] of the coefficients; the standard deviation contains those of the modes too.
/// @throws Error on an invalid tool, engagement or coefficient.
Estimate slotWidening(const CuttingCondition& cut, const CuttingCoefficients& coefficients,
                      double force_uncertainty, const ModalModel& across, const Uncertainty& uncertainty);

}  // namespace smartmill::loadmeter
