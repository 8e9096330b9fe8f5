#include "smartmill_discrepancy/search/prior_tension.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/gap/significance.h"
#include "smartmill_discrepancy/search/evidence.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/start_values.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {
namespace {

// [1] Reduction of the squared deviations from the stated values.
double tensionReduction(const PredictedGain& predicted) {
  return predicted.prior_evidence.squares + 2.0 * predicted.prior_evidence.product;
}

bool mayReduceTension(const Fitter& fitter, const PredictedGain& predicted, const SearchOptions& options) {
  return !predicted.start.empty() && predicted.gain > ValidationResult::requiredSquares() &&
         tensionReduction(predicted) > options.requiredPenaltyReduction() &&
         ValidationResult::isAcceptedByFitted(fittedScale(fitter, predicted));
}

// Whether nominal values deviate from their stated values by more than chance.
bool hasPriorTension(const Workbench& bench, const FitResult& fit) {
  const std::vector<Coordinate>& free = bench.freedom().coordinates();
  double squares = 0.0;
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double off = (fit.state.nominal[c] - free[c].null) / free[c].prior_std;
    squares += off * off;
  }
  // Missing effects displace them too.
  const double variance = std::max(1.0, fit.chi2 / bench.samples());
  return chiSquareTail(squares / variance, free.size() + free.size() % 2) < SIGNIFICANT;
}

}  // namespace

std::optional<FitState> resolvePriorTension(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                                            const SearchOptions& options, SearchResult* found) {
  if (!hasPriorTension(bench, found->best)) return {};
  const Fitter& quick = bench.quick();
  const NominalTangents tangents = bench.linearise(found->best.state);
  const NominalTangents alignment_tangents =
      tangents.ofAlignments();  // nominal values must be simulated to follow the valley
  const FitResult now = quick.fit(found->best.state, &tangents, FitOptions::toEvaluate());
  if (!now.converged) return {};
  ScreeningMemory memory;
  std::vector<PredictedGain> predictions =
      screen(quick, now, tangents, hypotheses, ValidationResult::requiredSquares(), &memory);
  // Many effects can follow the valley to some extent; those with few values are preferred.
  std::stable_sort(predictions.begin(), predictions.end(),
                   [](const PredictedGain& a, const PredictedGain& b) {
                     return a.hypothesis->coordinates.size() < b.hypothesis->coordinates.size();
                   });
  std::size_t round = 0;
  for (const Candidate& r : found->candidates) round = std::max(round, r.result.round + 1);
  const std::size_t first = found->candidates.size();
  std::optional<FitResult> best;
  for (const PredictedGain& predicted : predictions) {
    if (found->candidates.size() - first >= options.max_tension_fits || bench.cancelled()) break;
    if (!mayReduceTension(quick, predicted, options)) continue;
    FitState with = now.state;
    with.members.push_back({predicted.hypothesis, bestStart(quick, now, predicted)});
    FitResult tried;
    found->candidates.push_back(fitCandidate(
        quick, predicted, round, now,
        [&] { return quick.fit(with, &alignment_tangents, FitOptions::toCompare()); }, &tried));
    options.log(formatted("  prior tension, predicted gain %.4g, gain %.4g, reduction of the penalty %.4g  ",
                          predicted.gain, now.bic - tried.bic, now.penalty - tried.penalty) +
                predicted.hypothesis->title());
    if (tried.converged && reducesPriorTension(now, tried, options) && (!best || tried.bic < best->bic))
      best = std::move(tried);
  }
  if (!best) return {};
  for (std::size_t k = first; k < found->candidates.size(); ++k)
    found->candidates[k].result.accepted =
        found->candidates[k].hypothesis == best->state.members.back().hypothesis;
  return best->state;
}

}  // namespace smartmill::discrepancy
