#pragma once

#include <vector>

#include "smartmill_discrepancy/results/explanation.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Which names hold, and their values, where samples count by what they tell (Workbench::weighBy()). What is
/// looked for, and what is left at last, counts every sample alike, by its noise: only of a model that lacks
/// no more than names can say does what it leaves tell how much a sample is worth.
///
/// Where nominal values stand for an effect it is looked for here (search/strained.h).
/// @param found of a search; receives the names that hold, fitted with every sample alike
/// @param resembles receives the others
/// @return the same names with their weighed values; the bench counts every sample alike again
SearchResult challengeWeighed(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                              const SearchOptions& options, SearchResult* found,
                              std::vector<Resemblance>* resembles);

/// The last word, by weight, and the bench stays so; but where causes without a name were taken beside the
/// names, or in their place, every sample has counted alike in what was asked of them, and does.
/// @param weighed of challengeWeighed() @param found after causes without a name were looked for
SearchResult settledByWeight(Workbench& bench, SearchResult weighed, const SearchResult& found);

}  // namespace smartmill::discrepancy
