#pragma once

#include <vector>

#include "smartmill_discrepancy/explain/explain.h"

namespace smartmill::discrepancy {

/// Takes away effects that stand for another cause: the tests do not agree on such an effect's size, unless
/// it helps in those that it never saw; or it leaves much at the very places where it acts.
/// @param found what the search found; fitted anew without what is taken away
/// @param unexplained what found leaves of the fit tests; looked for anew likewise
void challenge(Workbench& bench, const ExplainOptions& options, const StructureOptions& structure,
               SearchResult* found, std::vector<Finding>* unexplained);

}  // namespace smartmill::discrepancy
