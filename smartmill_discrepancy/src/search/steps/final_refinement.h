#pragma once

#include "search/steps/search_step.h"

namespace smartmill::discrepancy {

struct FinalRefinementOptions {
  int max_swaps = 3;  ///< of an effect by an alternative; more would alternate between equal ones
};

/// Refines the fit with the exact twin, drops effects that have become unnecessary and swaps effects whose
/// refined alternatives are better.
class FinalRefinement : public SearchStep {
 public:
  explicit FinalRefinement(const FinalRefinementOptions& options = {}) : options_(options) {}

  void run(SearchState& state) override;

 private:
  bool swapBetterAlternatives(SearchState& state) const;

  FinalRefinementOptions options_;
};

}  // namespace smartmill::discrepancy
