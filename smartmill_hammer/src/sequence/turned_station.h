#pragma once

#include "smartmill_hammer/sequence/hammer_parameters.h"
#include "smartmill_hammer/sequence/measure_frf_result.h"

namespace smartmill::hammer {

/// FRFs and modes along the machine's axis of the goal, from hits along both axes of a station that is turned
/// about z: G = R G' R^T, with G' from the direct FRFs and the mean of both cross FRFs (reciprocity). Errors
/// are independent of one another.
/// @param first result of the goal's direction; gives what is not an FRF @param second of the other direction
/// @param angle [rad] from the machine's x to the station's
/// @param modes to fit; 0: all significant ones
/// @return code fit_failed where no mode fits
MeasureFrfResult alongMachineAxis(const MeasureFrfResult& first, const MeasureFrfResult& second, double angle,
                                  int modes, const HammerParameters& parameters);

}  // namespace smartmill::hammer
