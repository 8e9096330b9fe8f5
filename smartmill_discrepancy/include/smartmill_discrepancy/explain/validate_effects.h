#pragma once

#include <vector>

#include "smartmill_discrepancy/results/explanation.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Removes effects that the validation does not accept (ValidationResult), the weakest first, with a refit of
/// everything else.
/// @param found result of the search @param resembles receives the removed effects with the reason
void validateEffects(Workbench& bench, const SearchOptions& options, SearchResult* found,
                     std::vector<Resemblance>* resembles);

}  // namespace smartmill::discrepancy
