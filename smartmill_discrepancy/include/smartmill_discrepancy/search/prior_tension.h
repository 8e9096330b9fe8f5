#pragma once

#include <optional>
#include <vector>

#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Nominal values far from their stated values may replace an effect with the same response, so that the
/// residual does not show it. Finds the effect that removes this prior tension and that the fitted tests, the
/// priors among them, accept (ValidationResult).
/// @param found a refined fit with the current whitening of the bench; its candidates receive the fits
/// @return state with the effect; nothing without prior tension or without such an effect
std::optional<FitState> resolvePriorTension(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                                            const SearchOptions& options, SearchResult* found);

}  // namespace smartmill::discrepancy
