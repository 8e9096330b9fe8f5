#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// Derivatives with respect to the values of these members, one member after the other.
/// @param base receives the simulation of the state
SparseColumns memberTangents(const Fitter& fitter, const FitState& state,
                             const std::vector<std::size_t>& members, SimulatedChannels* base);

}  // namespace smartmill::discrepancy
