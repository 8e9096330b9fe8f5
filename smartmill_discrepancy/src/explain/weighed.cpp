#include "smartmill_discrepancy/explain/weighed.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "smartmill_discrepancy/explain/challenge.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/strained.h"

namespace smartmill::discrepancy {
namespace {

bool sameMembers(const FitState& a, const FitState& b) {
  return std::equal(a.members.begin(), a.members.end(), b.members.begin(), b.members.end(),
                    [](const Member& x, const Member& y) { return x.hypothesis == y.hypothesis; });
}

// What nominal values stand for.
void takeStrainOff(Workbench& bench, const std::vector<Hypothesis>& hypotheses, const SearchOptions& options,
                   SearchResult* found) {
  const std::optional<FitState> state = relieved(bench, hypotheses, options, found);
  if (!state) return;
  SearchResult with = *found;
  if (refine(bench, *state, options, &with)) *found = std::move(with);
}

}  // namespace

SearchResult challengeWeighed(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                              const SearchOptions& options, SearchResult* found,
                              std::vector<Resemblance>* resembles) {
  if (!bench.weighBy(found->best.state)) {
    takeStrainOff(bench, hypotheses, options, found);
    challenge(bench, options, found, resembles);
    return *found;
  }
  SearchResult weighed = *found;
  options.say("  samples count by what they tell");
  // Where the twin gives no numbers there, what was found stays without weights.
  if (refine(bench, found->best.state, options, &weighed)) {
    takeStrainOff(bench, hypotheses, options, &weighed);
  } else {
    bench.weighAlike();
  }
  challenge(bench, options, &weighed, resembles);
  bench.weighAlike();
  found->ladder = weighed.ladder;
  if (!sameMembers(weighed.best.state, found->best.state) &&
      !refine(bench, weighed.best.state, options, found))
    found->forgetMembers();
  bench.turnTo(found->best.state);
  return weighed;
}

SearchResult settledByWeight(Workbench& bench, SearchResult weighed, const SearchResult& found) {
  const FitState& state = found.best.state;
  if (!sameMembers(weighed.best.state, state) || !bench.weighBy(state)) return found;
  weighed.ladder = found.ladder;
  return weighed;
}

}  // namespace smartmill::discrepancy
