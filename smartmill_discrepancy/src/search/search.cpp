#include "smartmill_discrepancy/search/search.h"

#include <optional>
#include <utility>

#include "search/steps/search_step.h"

namespace smartmill::discrepancy {
namespace {

void run(const SearchSteps& steps, SearchState& state) {
  for (const std::unique_ptr<SearchStep>& step : steps) step->run(state);
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
    run(stepsOnWholeRecords(nullptr), state);
    return std::move(state.result);
  }
  Workbench shortened_bench(*short_data, bench.options());
  SearchState shortened(shortened_bench, hypotheses, options, false);
  run(stepsOnShortenedRecords(), shortened);
  run(stepsOnWholeRecords(&shortened), state);
  return std::move(state.result);
}

}  // namespace smartmill::discrepancy
