#include "smartmill_discrepancy/explain/challenge.h"

#include <algorithm>

#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/standing.h"

namespace smartmill::discrepancy {
namespace {

Resemblance resemblanceOf(const Member& member, const Standing& standing) {
  const AskedShare& asked = standing.weaker();
  const char* const tests = &asked == &standing.heldout ? "held-out tests" : "tests";
  const double percent = 100.0 * std::max(asked.share, 0.0);
  return {member.hypothesis->effect, member.hypothesis->variant,
          "nearest shape in the catalogue, but " +
              formatted("the %s ask for %.0f +- %.0f %% of it", tests, percent, 100.0 * asked.std_dev),
          standing.confidence()};
}

// An effect of fewer values that explains as much, as far as the tests can tell, and holds itself: the
// simpler name.
const Rival* simplerRival(const Workbench& bench, const SearchResult& found) {
  const FitState& best = found.best.state;
  const auto simpler = std::find_if(found.rivals.begin(), found.rivals.end(), [&](const Rival& r) {
    return r.state.members.back().values.size() < best.members[r.member].values.size() &&
           !standingOf(bench, best, r.state).holds() &&
           standingOf(bench, r.state, found.lacking[r.member]).holds();
  });
  return simpler == found.rivals.end() ? nullptr : &*simpler;
}

// @return false: none
bool takeSimpler(Workbench& bench, const SearchOptions& options, SearchResult* found) {
  const Rival* simpler = simplerRival(bench, *found);
  if (!simpler) return false;
  const Hypothesis& old = *found->best.state.members[simpler->member].hypothesis;
  const FitState state = simpler->state;
  const Hypothesis& name = *state.members.back().hypothesis;
  options.say("  the tests do not tell " + old.title() + " from the simpler " + name.title());
  found->tellSwapped(old, name);
  if (!refine(bench, state, options, found)) found->forgetMembers();
  return true;
}

}  // namespace

void challenge(Workbench& bench, const SearchOptions& options, SearchResult* found,
               std::vector<Resemblance>* resembles) {
  for (const Hypothesis* h : found->refused) {
    resembles->push_back({h->effect, h->variant,
                          "takes the shape of what is missing, but held-out tests are no nearer with it"});
  }
  while (!found->best.state.members.empty()) {
    const FitState& best = found->best.state;
    std::size_t weakest = best.members.size();
    Standing of_weakest;
    for (std::size_t m = 0; m < best.members.size(); ++m) {
      const Standing standing = standingOf(bench, best, found->lacking[m]);
      options.say(formatted("  %s: tests ask for %.3g +- %.2g of it, held-out ones for %.3g +- %.2g",
                            best.members[m].hypothesis->title().c_str(), standing.fitted.share,
                            standing.fitted.std_dev, standing.heldout.share, standing.heldout.std_dev));
      if (standing.holds() ||
          (weakest < best.members.size() && standing.weaker().beyond() >= of_weakest.weaker().beyond()))
        continue;
      weakest = m;
      of_weakest = standing;
    }
    if (weakest == best.members.size()) {
      if (takeSimpler(bench, options, found)) continue;
      return;
    }
    options.say("  does not hold: " + best.members[weakest].hypothesis->title());
    resembles->push_back(resemblanceOf(best.members[weakest], of_weakest));
    if (!refine(bench, without(best, weakest), options, found)) found->forgetMembers();
  }
}

}  // namespace smartmill::discrepancy
