#pragma once

#include "smartmill_discrepancy/explain/explain.h"

namespace smartmill::discrepancy {

/// Names the effects of a search with standard deviations, confidence and alternatives; what cannot be told
/// apart, and a test that would.
/// @param result receives effects (heldout_gap_reduction is left to who counts every sample alike),
/// not_separable and suggested_test
/// @return the improved model, standard deviations with it
MachineModel nameEffects(const Workbench& bench, const SearchOptions& options, const SearchResult& found,
                         Explanation* result);

/// From effects and unexplained.
Verdict verdictOf(const Explanation& result);

}  // namespace smartmill::discrepancy
