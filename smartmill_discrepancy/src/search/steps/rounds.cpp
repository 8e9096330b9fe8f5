#include <algorithm>
#include <cstddef>
#include <utility>

#include "search/adoption.h"
#include "search/candidate_round.h"
#include "search/steps/steps.h"
#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {
namespace {

class Rounds {
 public:
  void run(SearchState& state);

 private:
  // Fit and derivatives at the start of a round.
  struct RoundStart {
    FitResult fit;
    NominalTangents tangents;
  };
  bool addEffect(SearchState& state);
  bool isSupportedByHeldout(SearchState& state, const FitResult& before, const Hypothesis& newest) const;
  void reject(SearchState& state, RoundStart start, const Hypothesis* newest);
  void reportProgress(const SearchState& state) const;

  bool reverted_ = false;  // to the start of the last round, whose predictions remain valid
};

void Rounds::run(SearchState& s) {
  reportProgress(s);
  while (s.rounds < s.options.max_effects + s.uncounted_rounds && !s.bench.cancelled()) {
    const bool continues = addEffect(s);
    ++s.rounds;
    if (!continues) break;
    reportProgress(s);
  }
}

// @return false: the search ends
bool Rounds::addEffect(SearchState& s) {
  CandidateRound round(s);
  round.run(!reverted_);
  reverted_ = false;
  const std::size_t first = s.result.candidates.size();
  s.result.candidates.insert(s.result.candidates.end(), round.candidates().begin(), round.candidates().end());
  if (!round.improved()) return false;
  const Hypothesis* const newest = round.best().state.members.back().hypothesis;
  RoundStart before{s.now, std::move(s.tangents)};
  adopt(s, std::move(round.best()));
  // Earlier effects may have imitated the new one.
  s.now = withoutUnneeded(s.quick, std::move(s.now), s.tangents, s.options, false);
  const double exact_squares = s.bench.exactSquares(s.now.state);
  if (!(exact_squares < s.exact_now)) {
    s.options.log(s.gapText(exact_squares) + " when simulated exactly, rejected: " + newest->title());
    reject(s, std::move(before), newest);
    return true;
  }
  auto& rejected_by_heldout = s.result.rejected;
  if (!isSupportedByHeldout(s, before.fit, *newest)) {
    if (std::find(rejected_by_heldout.begin(), rejected_by_heldout.end(), newest) ==
        rejected_by_heldout.end())
      rejected_by_heldout.push_back(newest);
    reject(s, std::move(before), newest);
    return true;
  }
  s.rejected.clear();  // they were rejected without the new effect
  rejected_by_heldout.erase(std::remove(rejected_by_heldout.begin(), rejected_by_heldout.end(), newest),
                            rejected_by_heldout.end());
  for (std::size_t k = first; k < s.result.candidates.size(); ++k)
    s.result.candidates[k].result.accepted = s.result.candidates[k].hypothesis == newest;
  s.exact_now = exact_squares;
  s.options.log(s.gapText(s.now.chi2) + " with " + describe(s.now.state.members.back()));
  return true;
}

// An effect that does not reduce the gap of held-out tests imitates another one.
bool Rounds::isSupportedByHeldout(SearchState& s, const FitResult& before, const Hypothesis& newest) const {
  s.bench.alignment().alignTo(s.now.state);
  const EffectScale scale = validate(s.bench, s.now.state, before.state).heldout;
  if (!ValidationResult::isRejected(scale)) return true;
  s.options.log(
      formatted("effect scale of the held-out tests %.2g +- %.2g, rejected: ", scale.scale, scale.std_dev) +
      newest.title());
  return false;
}

void Rounds::reject(SearchState& s, RoundStart start, const Hypothesis* newest) {
  s.rejected.push_back(newest);
  reverted_ = true;
  ++s.uncounted_rounds;
  s.now = std::move(start.fit);
  if (s.bench.alignment().alignPhases(s.now.state) > 0.0) {
    s.linearise(s.now.state);
  } else {
    s.lineariseBy(std::move(start.tangents), s.now.state);
  }
  s.now = s.refit(s.now, FitOptions::closely());
  s.exact_now = s.bench.exactSquares(s.now.state);
}

// Work in units of a nominal fit, from typical campaigns: a round 2, the last one 1, the nominal fit of whole
// records 2, refinement with validation 4.
void Rounds::reportProgress(const SearchState& s) const {
  const double done = 1.0 + 2.0 * static_cast<double>(s.rounds) + (s.whole_records ? 2.0 : 0.0);
  s.options.reportProgress(done / (done + (s.whole_records ? 5.0 : 7.0)));
}

}  // namespace

void addEffects(SearchState& s) {
  Rounds().run(s);
}

}  // namespace smartmill::discrepancy
