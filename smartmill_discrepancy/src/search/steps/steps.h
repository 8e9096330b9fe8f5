#pragma once

#include <vector>

#include "search/search_state.h"

namespace smartmill::discrepancy {

// Steps of a search, in the order in which search() calls them. They depend on the state alone.

/// Fits the nominal values without effects, freely and, if that leaves a residual and the tool's displacement
/// is recorded, guided.
/// @throws Error if the twin gives no finite values for the nominal model
void fitNominal(SearchState& state);

/// The same, only as the state is guided.
/// @param from start
void fitNominalFrom(SearchState& state, const std::vector<double>& from);

/// Continues a search on shortened records with the whole records: nominal values and effects start from its
/// result.
void continueOnWholeRecords(SearchState& state, const SearchState& shortened);

/// Rounds of the search, each of which adds one effect: the best fit of a round is adopted and kept if the
/// exact twin and the held-out tests support it.
void addEffects(SearchState& state);

/// Ends the guidance if the free simulation follows the records.
void releaseGuidance(SearchState& state);

/// Refines the fit with the exact twin, drops effects that have become unnecessary and swaps effects whose
/// refined alternatives are better.
void refineFinally(SearchState& state);

}  // namespace smartmill::discrepancy
