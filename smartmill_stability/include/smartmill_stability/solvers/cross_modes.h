#pragma once

#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Modes of x and y with what a measured cross receptance says of their directions. A mode of a structure
/// whose principal directions are not x and y shows in both fits; modes of x and y whose half-power bands
/// meet are one such pair. The cross receptance's residue there, by least squares over its lines, makes with
/// their gains the pair's symmetric matrix of residues, which is the sum of two modes along its principal
/// directions. A residue below two of its standard deviations counts as none. Number and order are those of
/// systemModes(x, y).
/// @param cross [m/N] y for a force in x or the reverse (reciprocity); without lines: systemModes(x, y)
std::vector<SystemMode> crossModes(const ModalModel& x, const ModalModel& y, const FrequencyResponse& cross);

}  // namespace smartmill::stability
