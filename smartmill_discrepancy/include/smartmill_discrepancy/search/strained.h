#pragma once

#include <optional>
#include <vector>

#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Nominal values that fits have pulled further than what is stated of them lets them be may stand for an
/// effect that does what they do, so that what is left says nothing of it: the effect that takes the strain
/// off them, where the fit tests ask for it as they must where it is named. What is stated is one of these
/// (Standing).
/// @param found a refined fit, by the weights that the bench has now; its ladder receives what was tried
/// @return the state with it; none: nothing is strained, or nothing takes it off
std::optional<FitState> relieved(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                                 const SearchOptions& options, SearchResult* found);

}  // namespace smartmill::discrepancy
