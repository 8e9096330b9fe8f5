#pragma once

#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Modes of x and y with directions from a measured cross receptance. A mode whose principal direction is
/// neither x nor y appears in both fits; modes of x and y with overlapping half-power bands form such a pair.
/// The residue of the cross receptance (least squares over its lines) and the gains of the pair make a
/// symmetric residue matrix, which is the sum of two modes along its principal directions. A residue below
/// two standard deviations is taken as 0. Number and order of the modes are those of systemModes(x, y).
/// @param cross [m/N] y for a force in x or the reverse (reciprocity); empty: systemModes(x, y)
std::vector<SystemMode> crossModes(const ModalModel& x, const ModalModel& y, const FrequencyResponse& cross);

}  // namespace smartmill::stability
