#pragma once

#include "search/steps/search_step.h"

namespace smartmill::discrepancy {

struct GuidanceReleaseOptions {
  /// [1] Free over guided squares up to which the free simulation follows the records; a tool that chatters
  /// in it has a much larger ratio.
  double max_ratio = 2.0;
};

/// Ends the guidance if the free simulation follows the records.
class GuidanceRelease : public SearchStep {
 public:
  explicit GuidanceRelease(const GuidanceReleaseOptions& options = {}) : options_(options) {}

  void run(SearchState& state) override;

 private:
  GuidanceReleaseOptions options_;
};

}  // namespace smartmill::discrepancy
