#include "search/steps/steps.h"
#include "smartmill_discrepancy/search/refinement.h"

namespace smartmill::discrepancy {

void releaseGuidance(SearchState& s) {
  if (!s.bench.guidance().isActive()) return;
  refitSimplerAlternatives(s.quick, s.now, s.tangents, s.options, &s.result.candidates);
  const double guided = s.bench.exactSquares(s.now.state), free = s.bench.guidance().freeSquares(s.now.state);
  s.options.log("guided by the tool's displacement " + s.gapText(guided) + ", simulated freely " +
                s.gapText(free));
  if (free < s.options.max_free_ratio * guided) s.bench.guidance().set(false);
}

}  // namespace smartmill::discrepancy
