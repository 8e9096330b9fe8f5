#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// What the steps of a search work on: the current fit with its derivatives, what was tried, and the result.
struct SearchState {
  SearchState(Workbench& workbench, const std::vector<Hypothesis>& candidates,
              const SearchOptions& search_options, bool all_samples)
      : bench(workbench),
        quick(workbench.quick()),
        hypotheses(candidates),
        options(search_options),
        whole_records(all_samples) {}

  Workbench& bench;
  const Fitter& quick;
  const std::vector<Hypothesis>& hypotheses;
  const SearchOptions& options;
  const bool whole_records;  ///< false: search on shortened records

  FitResult now;
  NominalTangents tangents;  ///< valid near the current fit
  double exact_now = 0.0;    ///< squares of the exact twin
  ScreeningMemory memory;
  std::vector<PredictedGain> screened;      ///< predictions of the last round
  std::vector<const Hypothesis*> rejected;  ///< since the last accepted effect
  std::size_t rounds = 0;
  std::size_t uncounted_rounds = 0;  ///< not counted in SearchOptions::max_effects
  SearchResult result;

  /// The state with nominal values within the range in which derivatives are taken.
  FitState nearStated(const FitState& where) const;
  /// Corrects the quick twin at a state and computes the derivatives there.
  void linearise(const FitState& where) { tangents = bench.linearise(nearStated(where)); }
  /// The same with given derivatives.
  void lineariseBy(NominalTangents with, const FitState& where);
  /// Keeps the fit if the twin gives no finite values.
  FitResult refit(const FitResult& from, const FitOptions& fit_options) const;
  /// The fit after alignment of the records without spindle angle.
  FitResult withPhasesAligned(FitResult fit);

  /// Squares above the noise.
  double excess(const FitResult& fit) const { return fit.chi2 - bench.samples(); }
  /// Whether the current fit leaves a negligible excess.
  bool isExplained() const { return excess(now) < options.negligible_excess * bench.samples(); }
  std::string gapText(double squares) const;
};

/// A member as the log names it: title and values.
std::string describe(const Member& member);

}  // namespace smartmill::discrepancy
