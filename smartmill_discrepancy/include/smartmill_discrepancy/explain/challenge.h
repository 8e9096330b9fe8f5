#pragma once

#include <vector>

#include "smartmill_discrepancy/results/explanation.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Takes away effects that do not hold (Standing), the weakest first, everything else fitted anew.
/// @param found what the search found @param resembles receives what was taken away, with the reason
void challenge(Workbench& bench, const SearchOptions& options, SearchResult* found,
               std::vector<Resemblance>* resembles);

}  // namespace smartmill::discrepancy
