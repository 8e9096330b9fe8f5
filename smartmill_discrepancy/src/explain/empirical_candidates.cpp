#include "smartmill_discrepancy/explain/empirical_candidates.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/start_values.h"

namespace smartmill::discrepancy {

std::vector<FitResult> EmpiricalCandidates::fitsInAddition(const FitResult& now,
                                                           const NominalTangents& tangents,
                                                           const std::vector<Hypothesis>& forms,
                                                           double min_predicted, double least,
                                                           std::size_t most, SearchResult* found,
                                                           ScreeningMemory* memory) const {
  const std::size_t round = found->candidates.empty() ? 0 : found->candidates.back().result.round + 1;
  const Fitter& quick = bench_.quick();
  std::vector<FitResult> fits;
  std::size_t fitted = 0;
  FitOptions options = FitOptions::closely();
  options.to_beat = now.chi2 + now.penalty - least;
  for (const PredictedGain& p : screen(quick, now, tangents, forms, min_predicted, memory)) {
    if (p.gain < min_predicted || ++fitted > most || bench_.cancelled()) break;
    FitState with = now.state;
    with.members.push_back({p.hypothesis, bestStart(quick, now, p)});
    FitResult fit;
    found->candidates.push_back(fitCandidate(
        quick, p, round, now, [&] { return quick.fit(with, &tangents, options); }, &fit));
    const double gain = now.bic - fit.bic;
    options_.log(formatted("  empirical, predicted gain %.4g, gain %.4g: %s", p.gain, gain,
                           p.hypothesis->title().c_str()));
    if (fit.converged && gain > least) fits.push_back(std::move(fit));
  }
  return fits;
}

bool EmpiricalCandidates::accept(const FitResult& start, const FitState& before, SearchResult* found) const {
  const NominalTangents here = bench_.linearise(start.state);
  FitResult fit = bench_.quick().fit(start.state, &here, FitOptions::closely());
  if (!fit.converged || !reproduction_.isReproduced(before, fit)) return false;
  fit = withoutUnneeded(bench_.quick(), std::move(fit), here, options_, true);
  SearchResult more = *found;
  for (Candidate& r : more.candidates)
    r.result.accepted = r.result.accepted || r.hypothesis == fit.state.members.back().hypothesis;
  // The refined values must reproduce the gain, and the names must not explain more.
  if (!refine(bench_, fit.state, options_, &more) || !reproduction_.isReproduced(before, more.best))
    return false;
  // Against the replaced names the same rule applies as for a name.
  if (more.best.bic > found->best.bic - options_.min_gain ||
      !validate(bench_, more.best.state, found->best.state).isAccepted())
    return false;
  *found = std::move(more);
  return true;
}

bool EmpiricalCandidates::acceptFirst(std::vector<FitResult> fits, const FitState& before,
                                      SearchResult* found) const {
  std::sort(fits.begin(), fits.end(), [](const FitResult& a, const FitResult& b) { return a.bic < b.bic; });
  for (std::size_t k = 0; k < std::min(fits.size(), limits_.examined_fits) && !bench_.cancelled(); ++k) {
    if (accept(fits[k], before, found)) return true;
  }
  return false;
}

}  // namespace smartmill::discrepancy
