#include "search/steps/search_step.h"
#include "smartmill_discrepancy/search/refinement.h"

namespace smartmill::discrepancy {
namespace {

struct GuidanceReleaseOptions {
  /// [1] Free over guided squares up to which the free simulation follows the records.
  double max_ratio = 2.0;
};

/// Ends the guidance if the free simulation follows the records.
class GuidanceRelease : public SearchStep {
 public:
  void run(SearchState& state) override;

 private:
  GuidanceReleaseOptions options_;
};

void GuidanceRelease::run(SearchState& s) {
  if (!s.bench.guidance().isActive()) return;
  refitSimplerAlternatives(s.quick, s.now, s.tangents, &s.result.candidates);
  const double guided = s.bench.exactSquares(s.now.state), free = s.bench.guidance().freeSquares(s.now.state);
  s.options.log("guided by the tool's displacement " + s.gapText(guided) + ", simulated freely " +
                s.gapText(free));
  if (free < options_.max_ratio * guided) s.bench.guidance().set(false);
}

}  // namespace

std::unique_ptr<SearchStep> makeGuidanceRelease() {
  return std::make_unique<GuidanceRelease>();
}

}  // namespace smartmill::discrepancy
