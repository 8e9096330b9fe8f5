#pragma once

#include <optional>
#include <vector>

#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// Merges separately found pieces of one effect (modes of the tool, axis by axis) into one member, with the
/// newest values of each piece. @return nothing if there are none or no hypothesis has exactly these pieces
std::optional<FitState> withPiecesMerged(const FitState& state, const std::vector<Hypothesis>& hypotheses);

}  // namespace smartmill::discrepancy
