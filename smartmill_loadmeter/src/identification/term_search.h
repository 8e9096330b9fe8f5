#pragma once

#include <optional>

#include "load_regression.h"
#include "load_terms.h"

namespace smartmill::loadmeter {

struct TermSearchOptions {
  /// [1] reduction of the Bayesian information criterion that a further term requires: very strong evidence
  /// (Kass and Raftery 1995), since the best of several terms is chosen.
  double strong_evidence = 10.0;
  /// [1] share of the residual's squares that a further term must remove: a wrong term always removes some.
  double required_reduction = 0.5;
  FrictionStarts starts{{{0.1, 0.25}}, FrictionStarts().warmup_times};
};

/// Selects further terms of a regression by evidence.
class TermSearch {
 public:
  TermSearch(const LoadRegression& regression, const LoadPlan& plan, const TermSearchOptions& options = {})
      : regression_(regression), plan_(plan), options_(options) {}

  /// The fit with the further term of the largest evidence; empty: none has strong evidence.
  std::optional<LoadState> add(const LoadState& state) const;

 private:
  LoadSolution solveFromSeveralStarts(const LoadState& state, const LoadTerms& terms) const;

  const LoadRegression& regression_;
  const LoadPlan& plan_;
  TermSearchOptions options_;
};

}  // namespace smartmill::loadmeter
