#pragma once

#include <vector>

#include "smartmill_discrepancy/results/explanation.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Validates the names with whitened residuals (Workbench::whitenAt()). Search and final residual use
/// unweighted samples: only the residual of a model that lacks no named effect shows how samples are
/// correlated.
/// Effects hidden in nominal values under prior tension are searched here (search/prior_tension.h).
/// @param found result of the search; receives the accepted names, fitted without whitening @param resembles
/// receives the others
/// @return the same names with the values of the whitened fit; the bench is without whitening again
SearchResult validateWhitened(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                              const SearchOptions& options, SearchResult* found,
                              std::vector<Resemblance>* resembles);

/// The final result. It is the whitened fit, and the bench stays whitened, unless empirical effects were
/// added: these were validated without whitening, and so is the result.
/// @param whitened of validateWhitened() @param found after the search for empirical effects
SearchResult finalResult(Workbench& bench, SearchResult whitened, const SearchResult& found);

}  // namespace smartmill::discrepancy
