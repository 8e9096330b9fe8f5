#pragma once

#include <cstddef>

#include "search/adoption.h"
#include "search/candidate_round.h"
#include "search/steps/search_step.h"

namespace smartmill::discrepancy {

struct RoundsOptions {
  /// Consecutive rejections that end the search: what remains is not in the catalogue.
  std::size_t max_rejections = 3;
  /// Work in units of a nominal fit, from typical campaigns: a round, the last round, the nominal fit of
  /// whole records, and refinement with validation. Steers the progress only.
  double round_work = 2.0, last_round_work = 1.0, whole_records_work = 2.0, later_work = 4.0;
};

/// Rounds of the search, each of which adds one effect: the best fit of a round is adopted and kept if the
/// exact twin and the held-out tests support it.
class Rounds : public SearchStep {
 public:
  explicit Rounds(const RoundsOptions& options = {}) : options_(options) {}

  void run(SearchState& state) override;

 private:
  // Fit and derivatives at the start of a round.
  struct RoundStart {
    FitResult fit;
    NominalTangents tangents;
  };
  bool addEffect(SearchState& state);
  bool isSupportedByHeldout(SearchState& state, const FitResult& before, const Hypothesis& newest) const;
  void reject(SearchState& state, RoundStart start, const Hypothesis* newest);
  void revertTo(SearchState& state, RoundStart start) const;
  void reportProgress(const SearchState& state) const;

  RoundsOptions options_;
  Adoption adoption_;
  bool reverted_ = false;  // to the start of the last round, whose predictions remain valid
  std::size_t rejections_in_a_row_ = 0;
};

}  // namespace smartmill::discrepancy
