#include "search/steps/steps.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::discrepancy {
namespace {

// Returns to the stated values if the fit moved to values at which the tool chatters.
void useStatedIfBetter(SearchState& s) {
  FitState stated = s.now.state;
  stated.nominal.assign(stated.nominal.size(), 0.0);
  if (!(s.bench.exactSquares(stated) < s.now.chi2)) return;
  s.linearise(stated);
  s.now = s.quick.fit(stated, &s.tangents, FitOptions::toEvaluate());
}

}  // namespace

void fitNominal(SearchState& s) {
  const std::vector<double> stated(s.bench.freedom().coordinates().size(), 0.0);
  fitNominalFrom(s, stated);
  if (!s.bench.guidance().isPossible() || s.isExplained() || s.bench.cancelled()) return;
  const FitResult free = s.now;
  NominalTangents free_tangents = std::move(s.tangents);
  s.bench.guidance().set(true);
  fitNominalFrom(s, stated);
  if (s.now.chi2 < free.chi2) {
    s.options.log("  guided by the displacement of the tool");
    return;
  }
  s.bench.guidance().set(false);
  s.now = s.result.null = free;
  s.lineariseBy(std::move(free_tangents), s.now.state);
  s.exact_now = s.bench.exactSquares(s.now.state);
}

void fitNominalFrom(SearchState& s, const std::vector<double>& from) {
  s.now = FitResult{};
  s.now.state.nominal = from;
  const bool without_angle = s.bench.alignment().phasesEstimated();
  const int passes = without_angle ? s.options.nominal_passes_without_angle : s.options.nominal_passes;
  const double share = without_angle ? s.options.nominal_settled_without_angle : s.options.nominal_settled;
  bool settled = false;
  for (int pass = 0; pass < passes; ++pass) {
    s.bench.guidance().updateWeights(s.nearStated(s.now.state));
    if (pass < s.options.fresh_nominal_passes) {
      s.linearise(s.now.state);
    } else {
      s.lineariseBy(std::move(s.tangents), s.now.state);
    }
    FitResult fit = s.quick.fit(s.now.state, &s.tangents, FitOptions::tightly());
    if (!fit.converged && pass == 0)
      throw Error(s.bench.data().campaign.folder + ": the twin gives no finite values for the nominal model");
    if (!fit.converged) break;
    settled = pass > 0 && std::abs(s.now.bic - fit.bic) < std::max(1.0, share * fit.bic);
    s.now = std::move(fit);
    if (settled || s.bench.cancelled()) break;
  }
  if (settled && !without_angle) {
    s.lineariseBy(std::move(s.tangents), s.now.state);
  } else {
    s.linearise(s.now.state);
  }
  s.now = s.withPhasesAligned(s.refit(s.now, {3, 1e-5}));
  useStatedIfBetter(s);
  s.result.null = s.now;
  s.options.log("nominal model, values free within their uncertainty: " + s.gapText(s.now.chi2));
  // The quick twin may differ from the exact one away from its correction: near the stability limit only one
  // of them may vibrate.
  s.exact_now = s.bench.exactSquares(s.now.state);
}

}  // namespace smartmill::discrepancy
