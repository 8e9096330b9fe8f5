#include "smartmill_discrepancy/search/strained.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/gap/significance.h"
#include "smartmill_discrepancy/search/evidence.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/standing.h"

namespace smartmill::discrepancy {
namespace {

// [1] By which the squares of the stated values' deviations shrink.
double reliefOf(const Promise& promise) {
  return promise.stated.squares + 2.0 * promise.stated.product;
}

bool mayRelieve(const Fitter& fitter, const Promise& promise, const SearchOptions& options) {
  return !promise.start.empty() && promise.gain > Standing::tellingSquares() &&
         reliefOf(promise) > 4.0 * options.least_prior_gain &&
         Standing::holdsInFitted(fittedShare(fitter, promise));
}

// Off by more than chance lets stated values be.
bool isStrained(const Workbench& bench, const Fit& fit) {
  constexpr double CHANCE = 1e-4;
  const std::vector<Coordinate>& free = bench.freedom().coordinates();
  double squares = 0.0;
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double off = (fit.state.nominal[c] - free[c].null) / free[c].prior_std;
    squares += off * off;
  }
  // What is missing besides pulls them too.
  const double variance = std::max(1.0, fit.chi2 / bench.samples());
  return chiSquareTail(squares / variance, free.size() + free.size() % 2) < CHANCE;
}

}  // namespace

std::optional<FitState> relieved(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                                 const SearchOptions& options, SearchResult* found) {
  constexpr std::size_t MOST = 3;  // are fitted
  if (!isStrained(bench, found->best)) return {};
  const Fitter& quick = bench.quick();
  const NominalTangents tangents = bench.linearise(found->best.state);
  const NominalTangents turns = tangents.ofTurns();  // only all values moved together go along that valley
  const Fit now = quick.fit(found->best.state, &tangents, {0, 1e-8, true});
  if (!now.converged) return {};
  ScreeningMemory memory;
  std::vector<Promise> promises =
      screen(quick, now, tangents, hypotheses, Standing::tellingSquares(), &memory);
  // Nearly all of them can go along that valley somehow; the one that is made for it needs few values.
  std::stable_sort(promises.begin(), promises.end(), [](const Promise& a, const Promise& b) {
    return a.hypothesis->coordinates.size() < b.hypothesis->coordinates.size();
  });
  std::size_t round = 0;
  for (const Rung& r : found->ladder) round = std::max(round, r.tried.round + 1);
  const std::size_t first = found->ladder.size();
  std::optional<Fit> best;
  for (const Promise& p : promises) {
    if (found->ladder.size() - first >= MOST || bench.cancelled()) break;
    if (!mayRelieve(quick, p, options)) continue;
    FitState with = now.state;
    with.members.push_back({p.hypothesis, bestStart(quick, now, p)});
    Fit tried;
    found->ladder.push_back(rungOf(
        quick, p, round, now,
        [&] {
          return quick.fit(with, &turns, {6, 1e-3, true});
        },
        &tried));
    options.say(
        formatted("  nominal values strained, promise %.4g, gain %.4g, stated values nearer by %.4g  ",
                  p.gain, now.bic - tried.bic, now.penalty - tried.penalty) +
        p.hypothesis->title());
    if (tried.converged && relieves(now, tried, options) && (!best || tried.bic < best->bic))
      best = std::move(tried);
  }
  if (!best) return {};
  for (std::size_t k = first; k < found->ladder.size(); ++k)
    found->ladder[k].tried.taken = found->ladder[k].hypothesis == best->state.members.back().hypothesis;
  return best->state;
}

}  // namespace smartmill::discrepancy
