#pragma once

#include <array>
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
  /// @{ Starting points of the nonlinear friction terms, which have local minima: Stribeck speed over the
  /// fastest [1]; time constant of the warm-up [s], 2.5 to 40 minutes in steps of a factor of four.
  std::array<double, 2> stribeck_shares{{0.1, 0.25}};
  std::array<double, 3> warmup_times{{150.0, 600.0, 2400.0}};
  /// @}
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
