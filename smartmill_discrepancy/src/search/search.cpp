#include "smartmill_discrepancy/search/search.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "search/steps/steps.h"

namespace smartmill::discrepancy {
namespace {

void finish(SearchState& state) {
  addEffects(state);
  releaseGuidance(state);
  refineFinally(state);
}

// Neither fitted nor screened with too small a gain.
std::vector<const Hypothesis*> notTried(const SearchState& state,
                                        const std::vector<PredictedGain>& screened) {
  std::vector<const Hypothesis*> not_tried;
  for (const Hypothesis& h : state.hypotheses) {
    const auto is = [&h](const auto& one) { return one.hypothesis == &h; };
    const auto& fitted = state.result.candidates;
    const auto predicted = std::find_if(screened.begin(), screened.end(), is);
    const bool too_small = predicted != screened.end() && predicted->gain < state.options.min_gain;
    if (!too_small && std::none_of(fitted.begin(), fitted.end(), is)) not_tried.push_back(&h);
  }
  return not_tried;
}

}  // namespace

void SearchResult::markReplaced(const Hypothesis& old, const Hypothesis& improved) {
  for (Candidate& r : candidates) {
    if (r.result.effect == old.effect && r.result.variant == old.variant) r.result.accepted = false;
    if (r.result.effect == improved.effect && r.result.variant == improved.variant) r.result.accepted = true;
  }
}

SearchResult search(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                    const SearchOptions& options) {
  SearchState state(bench, hypotheses, options, true);
  const std::optional<Dataset> short_data =
      hasToolModes(bench.data().nominal) ? shortenedDataset(bench.data()) : std::nullopt;
  if (!short_data) {
    fitNominal(state);
    finish(state);
    if (bench.cancelled()) state.result.not_tried = notTried(state, state.screened);
    return std::move(state.result);
  }
  Workbench shortened_bench(*short_data, bench.options());
  SearchState shortened(shortened_bench, hypotheses, options, false);
  fitNominal(shortened);
  addEffects(shortened);
  continueOnWholeRecords(state, shortened);
  finish(state);
  if (bench.cancelled())
    state.result.not_tried = notTried(state, state.screened.empty() ? shortened.screened : state.screened);
  return std::move(state.result);
}

}  // namespace smartmill::discrepancy
