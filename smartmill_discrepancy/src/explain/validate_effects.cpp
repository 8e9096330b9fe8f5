#include "smartmill_discrepancy/explain/validate_effects.h"

#include <algorithm>

#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {
namespace {

Resemblance resemblanceOf(const Member& member, const ValidationResult& validation) {
  const EffectScale& scale = validation.weakerGroup();
  const char* const tests = &scale == &validation.heldout ? "held-out tests" : "tests";
  const double percent = 100.0 * std::max(scale.scale, 0.0);
  return {member.hypothesis->effect, member.hypothesis->variant,
          "closest effect of the catalogue, but " +
              formatted("the %s prefer %.0f +- %.0f %% of it", tests, percent, 100.0 * scale.std_dev)};
}

// An accepted alternative with fewer values that the tests do not distinguish from the member.
const Alternative* simplerAlternative(const Workbench& bench, const SearchResult& found) {
  const FitState& best = found.best.state;
  const auto simpler =
      std::find_if(found.alternatives.begin(), found.alternatives.end(), [&](const Alternative& r) {
        return r.state.members.back().values.size() < best.members[r.member].values.size() &&
               !validate(bench, best, r.state).isAccepted() &&
               validate(bench, r.state, found.without_member[r.member]).isAccepted();
      });
  return simpler == found.alternatives.end() ? nullptr : &*simpler;
}

// @return false: there is none
bool replaceBySimpler(Workbench& bench, const SearchOptions& options, SearchResult* found) {
  const Alternative* simpler = simplerAlternative(bench, *found);
  if (!simpler) return false;
  const Hypothesis& old = *found->best.state.members[simpler->member].hypothesis;
  const FitState state = simpler->state;
  const Hypothesis& name = *state.members.back().hypothesis;
  options.log("  the tests do not distinguish " + old.title() + " from the simpler " + name.title());
  found->markReplaced(old, name);
  if (!refine(bench, state, options, found)) found->clearMembers();
  return true;
}

}  // namespace

void validateEffects(Workbench& bench, const SearchOptions& options, SearchResult* found,
                     std::vector<Resemblance>* resembles) {
  for (const Hypothesis* h : found->rejected) {
    resembles->push_back(
        {h->effect, h->variant, "reduces the residual of the fitted tests, but not of the held-out tests"});
  }
  while (!found->best.state.members.empty()) {
    const FitState& best = found->best.state;
    std::size_t weakest = best.members.size();
    ValidationResult weakest_validation;
    for (std::size_t m = 0; m < best.members.size(); ++m) {
      const ValidationResult validation = validate(bench, best, found->without_member[m]);
      options.log("  " + best.members[m].hypothesis->title() + ": " + validation.text());
      if (validation.isAccepted() ||
          (weakest < best.members.size() &&
           validation.weakerGroup().margin() >= weakest_validation.weakerGroup().margin()))
        continue;
      weakest = m;
      weakest_validation = validation;
    }
    if (weakest == best.members.size()) {
      if (replaceBySimpler(bench, options, found)) continue;
      return;
    }
    options.log("  rejected: " + best.members[weakest].hypothesis->title());
    resembles->push_back(resemblanceOf(best.members[weakest], weakest_validation));
    if (!refine(bench, without(best, weakest), options, found)) found->clearMembers();
  }
}

}  // namespace smartmill::discrepancy
