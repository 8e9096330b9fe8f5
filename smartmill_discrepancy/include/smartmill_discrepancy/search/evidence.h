#pragma once

#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Least significant BIC gain: at least the squares by which two accurate simulations differ in the channels
/// where the fits differ.
double requiredGain(const TwinRunner& runner, const FitResult& less, const FitResult& more,
                    const SearchOptions& options);

/// Whether a fit brings nominal values significantly closer to their stated values; an effect may be required
/// even if the nominal values could replace it.
bool reducesPriorTension(const FitResult& less, const FitResult& more, const SearchOptions& options);

/// Whether the larger model is significantly better.
bool isSignificant(const TwinRunner& runner, const FitResult& less, const FitResult& more,
                   const SearchOptions& options);

}  // namespace smartmill::discrepancy
