#include <algorithm>

#include "search/steps/steps.h"
#include "smartmill_discrepancy/search/refinement.h"

namespace smartmill::discrepancy {
namespace {

// Candidates of a round are compared before convergence; compares their refined fits.
// @return false: the twin gives no finite values
bool swapBetterAlternatives(SearchState& s) {
  SearchResult& result = s.result;
  for (int swap = 0; swap < s.options.max_swaps && !s.bench.cancelled(); ++swap) {
    const auto ahead = [&](const Alternative& r) { return r.delta_bic - result.contribution[r.member]; };
    const auto best =
        std::max_element(result.alternatives.begin(), result.alternatives.end(),
                         [&](const Alternative& a, const Alternative& b) { return ahead(a) < ahead(b); });
    if (best == result.alternatives.end() || ahead(*best) <= 0.0) return true;
    const Hypothesis& old = *result.best.state.members[best->member].hypothesis;
    const Hypothesis& improved = *best->state.members.back().hypothesis;
    s.options.log("  replaced: " + old.title() + " by " + improved.title());
    result.markReplaced(old, improved);
    const FitState state = best->state;
    if (!refine(s.bench, state, s.options, &result)) return false;
  }
  return true;
}

}  // namespace

void refineFinally(SearchState& s) {
  s.bench.guidance().guideNearLimit(s.now.state);
  s.bench.guidance().updateWeights(s.now.state);
  SearchResult& result = s.result;
  result.best = s.now;
  bool refined = refine(s.bench, s.now.state, s.options, &result);
  // Effects may become unnecessary after the refinement.
  while (refined && !result.contribution.empty()) {
    const auto least = std::min_element(result.contribution.begin(), result.contribution.end());
    const auto m = static_cast<std::size_t>(least - result.contribution.begin());
    if (result.is_needed[m]) break;
    s.options.log("  no longer needed: " + result.best.state.members[m].hypothesis->title());
    refined = refine(s.bench, without(result.best.state, m), s.options, &result);
  }
  if (refined) refined = swapBetterAlternatives(s);
  if (!refined) result.clearMembers();
  for (const Member& m : result.best.state.members) s.options.log("found " + describe(m));
}

}  // namespace smartmill::discrepancy
