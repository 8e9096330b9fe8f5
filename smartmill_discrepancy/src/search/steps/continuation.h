#pragma once

#include "search/adoption.h"
#include "search/steps/nominal_fit.h"
#include "search/steps/search_step.h"

namespace smartmill::discrepancy {

struct ContinuationOptions {
  /// [1] of the required gain: smaller gains of shortened records, in proportion to the samples, are not
  /// screened again.
  double worth_screening = 0.25;
};

/// Continues a search on shortened records with the whole records: nominal values and effects start from its
/// result.
class Continuation : public SearchStep {
 public:
  explicit Continuation(const SearchState& shortened, const ContinuationOptions& options = {})
      : shortened_(shortened), options_(options) {}

  void run(SearchState& state) override;

 private:
  void limitGains(SearchState& state) const;

  const SearchState& shortened_;
  ContinuationOptions options_;
  NominalFit nominal_fit_;
  Adoption adoption_;
};

}  // namespace smartmill::discrepancy
