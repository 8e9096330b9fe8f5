#include "smartmill_discrepancy/explain/whitened_refit.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "smartmill_discrepancy/explain/validate_effects.h"
#include "smartmill_discrepancy/search/prior_tension.h"
#include "smartmill_discrepancy/search/refinement.h"

namespace smartmill::discrepancy {
namespace {

bool sameMembers(const FitState& a, const FitState& b) {
  return std::equal(a.members.begin(), a.members.end(), b.members.begin(), b.members.end(),
                    [](const Member& x, const Member& y) { return x.hypothesis == y.hypothesis; });
}

// Adds effects hidden in nominal values.
void resolveTension(Workbench& bench, const std::vector<Hypothesis>& hypotheses, const SearchOptions& options,
                    SearchResult* found) {
  const std::optional<FitState> state = resolvePriorTension(bench, hypotheses, options, found);
  if (!state) return;
  SearchResult with = *found;
  if (refine(bench, *state, options, &with)) *found = std::move(with);
}

}  // namespace

SearchResult validateWhitened(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                              const SearchOptions& options, SearchResult* found,
                              std::vector<Resemblance>* resembles) {
  if (!bench.whitenAt(found->best.state)) {
    resolveTension(bench, hypotheses, options, found);
    validateEffects(bench, options, found, resembles);
    return *found;
  }
  SearchResult whitened = *found;
  options.log("  refit with whitened residuals");
  // Without a converged whitened fit the result is kept without whitening.
  if (refine(bench, found->best.state, options, &whitened)) {
    resolveTension(bench, hypotheses, options, &whitened);
  } else {
    bench.clearWhitening();
  }
  validateEffects(bench, options, &whitened, resembles);
  bench.clearWhitening();
  found->candidates = whitened.candidates;
  if (!sameMembers(whitened.best.state, found->best.state) &&
      !refine(bench, whitened.best.state, options, found))
    found->clearMembers();
  bench.alignment().alignTo(found->best.state);
  return whitened;
}

SearchResult finalResult(Workbench& bench, SearchResult whitened, const SearchResult& found) {
  const FitState& state = found.best.state;
  if (!sameMembers(whitened.best.state, state) || !bench.whitenAt(state)) return found;
  whitened.candidates = found.candidates;
  return whitened;
}

}  // namespace smartmill::discrepancy
