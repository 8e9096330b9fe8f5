#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_discrepancy/fit.h"
#include "smartmill_discrepancy/screening.h"

namespace smartmill::discrepancy {

struct SearchOptions {
  int threads = 2;
  int screening_substeps = 2;
  int final_substeps = 8;
  std::size_t fitted_per_round = 5;  ///< hypotheses that a round fits after screening
  std::size_t most_effects = 4;
  double least_gain = 30.0;          ///< [1] difference of BIC below which nothing is named
  std::function<void(const std::string&)> progress;
};

/// One rung of the evidence ladder: an effect that was fitted beside those found before it.
struct Rung {
  std::size_t round = 0;  ///< counts from 0
  std::string effect, variant;
  double promised = 0.0;   ///< gain of the screening
  double delta_bic = 0.0;  ///< of the fit against the round's start; positive is better
  bool taken = false;
};

struct SearchResult {
  Fit null;          ///< nominal values only, on the fit tests
  Fit best;          ///< with the effects found
  std::vector<Rung> ladder;
  std::vector<double> contribution;  ///< of each member: BIC that is lost without it, others fitted again
  /// Effects that the data cannot tell apart from a member, first the member.
  std::vector<std::vector<std::string>> not_separable;
};

/// Forward addition of effects with re-fitting and pruning, on the tests of the runner.
SearchResult search(const Fitter& quick, const Fitter& exact, const std::vector<Hypothesis>& hypotheses,
                    const SearchOptions& options);

}  // namespace smartmill::discrepancy
