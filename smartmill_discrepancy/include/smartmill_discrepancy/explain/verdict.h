#pragma once

#include "smartmill_discrepancy/explain/explain.h"

namespace smartmill::discrepancy {

/// Describes the effects of a search with standard deviations, confidence and alternatives, unidentifiable
/// pairs and a test that separates them.
/// @param result receives effects (except heldout_gap_reduction, which needs unweighted samples),
/// not_separable and suggested_test
/// @return improved model with standard deviations
MachineModel nameEffects(const Workbench& bench, const SearchOptions& options, const SearchResult& found,
                         Explanation* result);

/// From effects, unexplained findings and the gap.
/// @param negligible_excess [1] of the squares of the noise: what nominal values remove below is no
/// disagreement
Verdict verdictOf(const Explanation& result, double negligible_excess);

}  // namespace smartmill::discrepancy
