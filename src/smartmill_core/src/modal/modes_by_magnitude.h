#pragma once

#include "residual_modes.h"

namespace smartmill {

/// Adds modes of clear peaks whose phase does not identify a mode (few lines on a peak, random excitation),
/// fitted to the logarithm of the magnitude.
void addByMagnitude(ResidualModes& modes, const ModalEstimateOptions& options);

}  // namespace smartmill
