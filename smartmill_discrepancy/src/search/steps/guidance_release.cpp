#include "search/steps/guidance_release.h"

#include "smartmill_discrepancy/search/refinement.h"

namespace smartmill::discrepancy {

void GuidanceRelease::run(SearchState& s) {
  if (!s.bench.guidance().isActive()) return;
  refitSimplerAlternatives(s.quick, s.now, s.tangents, &s.result.candidates);
  const double guided = s.bench.exactSquares(s.now.state), free = s.bench.freeSquares(s.now.state);
  s.options.log("guided by the tool's displacement " + s.gapText(guided) + ", simulated freely " +
                s.gapText(free));
  if (free < options_.max_ratio * guided) s.bench.guidance().set(false);
}

}  // namespace smartmill::discrepancy
