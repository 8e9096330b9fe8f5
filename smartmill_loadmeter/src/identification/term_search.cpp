#include "term_search.h"

#include <algorithm>
#include <utility>

namespace smartmill::loadmeter {

// A further friction term is fitted from several starting points.
LoadSolution TermSearch::solveFromSeveralStarts(const LoadState& state, const LoadTerms& terms) const {
  const LoadTerms& now = state.solution.terms;
  std::optional<LoadSolution> best;
  for (const double share : options_.starts.stribeck_shares) {
    for (const double constant : options_.starts.warmup_times) {
      FrictionLaw start = state.friction;
      if (!now.stribeck) start.stribeck_speed = std::max(share * plan_.fastest, plan_.slowest);
      if (!now.warmup) start.warmup_time = constant;
      const LoadSolution s = regression_.solve(state, terms, start);
      if (!best || s.bic < best->bic) best = s;
      if (!terms.warmup || now.warmup) break;
    }
    if (!terms.stribeck || now.stribeck) break;
  }
  return *best;
}

std::optional<LoadState> TermSearch::add(const LoadState& state) const {
  std::optional<LoadState> best;
  const std::size_t residuals = regression_.residualCount(state);
  for (const FurtherTerm& term : furtherTerms()) {
    LoadTerms terms = state.solution.terms;
    if (terms.*term.flag || !term.isObservable(plan_)) continue;
    terms.*term.flag = true;
    if (terms.count() + 2 > residuals) continue;
    LoadState candidate = state;
    if (term.linearised) {
      candidate = regression_.converge(std::move(candidate), terms);
    } else {
      candidate.solution = solveFromSeveralStarts(state, terms);
    }
    if (!best || candidate.solution.bic < best->solution.bic) best = std::move(candidate);
  }
  if (!best || best->solution.bic > state.solution.bic - options_.strong_evidence) return std::nullopt;
  const auto squares = [](const LoadState& s) { return s.solution.fit.squares * s.noise * s.noise; };
  if (squares(*best) > options_.required_reduction * squares(state)) return std::nullopt;
  best->friction = regression_.frictionOf(best->solution);
  const LoadTerms terms = best->solution.terms;
  return regression_.converge(std::move(*best), terms);
}

}  // namespace smartmill::loadmeter
