#include "search/adoption.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "search/merged_pieces.h"
#include "smartmill_discrepancy/search/evidence.h"

namespace smartmill::discrepancy {

void Adoption::adopt(SearchState& s, FitResult best) const {
  s.linearise(best.state);
  if (const auto one = withPiecesMerged(best.state, s.hypotheses)) {
    FitResult merged_state = s.quick.fit(*one, &s.tangents, FitOptions::closely());
    if (merged_state.bic < best.bic) {
      best = std::move(merged_state);
      s.linearise(best.state);
    }
  }
  const FitResult refined = s.refit(best, FitOptions::closely());
  // Derivatives are valid near the start of the fit.
  if (best.bic - refined.bic > options_.far * refined.bic) {
    s.linearise(refined.state);
  } else {
    s.lineariseBy(std::move(s.tangents), refined.state);
  }
  s.now = s.withPhasesAligned(s.refit(refined, FitOptions::closely()));
  refitFromStated(s);
  for (int pass = 0; pass < options_.passes; ++pass) {
    s.lineariseBy(std::move(s.tangents), s.now.state);
    if (s.bench.cancelled()) break;
    const double before = s.now.bic;
    s.now = s.refit(s.now, FitOptions::closely());
    if (before - s.now.bic < std::max(s.options.min_gain, s.options.min_share * s.excess(s.now))) break;
  }
}

// An effect fitted next to strongly displaced nominal values may be in a wrong valley: fits it with stated
// values, then with all values free. The quick twin remains corrected at the last state.
void Adoption::refitFromStated(SearchState& s) const {
  if (s.nearStated(s.now.state).nominal == s.now.state.nominal) return;
  FitState stated = s.now.state;
  stated.nominal.assign(stated.nominal.size(), 0.0);
  FitOptions with_stated = FitOptions::closely();
  with_stated.nominal_free = false;
  const FitResult at_stated = s.quick.fit(stated, nullptr, with_stated);
  if (!at_stated.converged || at_stated.chi2 > options_.give_up_ratio * s.now.chi2) return;
  NominalTangents there = s.bench.linearise(s.nearStated(at_stated.state));
  FitResult free = s.quick.fit(at_stated.state, &there, FitOptions::closely());
  if (!free.converged || free.bic >= s.now.bic) return;
  s.lineariseBy(std::move(there), free.state);
  s.now = s.withPhasesAligned(s.refit(free, FitOptions::closely()));
}

void Adoption::dropUnneeded(SearchState& s) const {
  for (std::size_t m = 0; m < s.now.state.members.size() && s.now.state.members.size() > 1;) {
    FitResult less = s.quick.fit(without(s.now.state, m), &s.tangents, FitOptions::toCompare());
    if (!isSignificant(s.quick.runner(), less, s.now, s.options)) {
      s.options.log("  no longer needed: " + s.now.state.members[m].hypothesis->title());
      s.now = std::move(less);
    } else {
      ++m;
    }
  }
}

}  // namespace smartmill::discrepancy
