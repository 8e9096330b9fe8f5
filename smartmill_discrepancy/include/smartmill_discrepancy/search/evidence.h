#pragma once

#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Gain of BIC below which one fit is not better than another: in the channels in which they differ two
/// faithful simulations differ by so many squares.
double leastGain(const TwinRunner& runner, const Fit& less, const Fit& more, const SearchOptions& options);

/// Nominal values pulled far off their stated uncertainty speak for an effect even where they could stand for
/// it.
bool relieves(const Fit& less, const Fit& more, const SearchOptions& options);

/// Whether a fit is better than one with less in it.
bool tells(const TwinRunner& runner, const Fit& less, const Fit& more, const SearchOptions& options);

}  // namespace smartmill::discrepancy
