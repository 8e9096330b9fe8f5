#include "search/search_state.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill::discrepancy {

FitState SearchState::nearStated(const FitState& where) const {
  FitState at = where;
  const std::vector<Coordinate>& free = bench.freedom().coordinates();
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double reach = options.near_stated * free[c].prior_std;
    at.nominal[c] = std::clamp(at.nominal[c], free[c].null - reach, free[c].null + reach);
  }
  return at;
}

void SearchState::lineariseBy(NominalTangents with, const FitState& where) {
  tangents = bench.lineariseBy(std::move(with), nearStated(where));
}

FitResult SearchState::refit(const FitResult& from, const FitOptions& fit_options) const {
  FitResult fit = quick.fit(from.state, &tangents, fit_options);
  return fit.converged ? fit : from;
}

FitResult SearchState::withPhasesAligned(FitResult fit) {
  for (int pass = 0;
       pass < options.alignment_passes && bench.alignment().phasesEstimated() && !bench.cancelled(); ++pass) {
    const double rotation = bench.alignment().alignPhases(fit.state);
    if (rotation == 0.0) break;
    if (rotation > options.large_rotation) memory.clear();
    linearise(fit.state);
    const double before = fit.bic;
    fit = refit(fit, FitOptions::closely());
    if (std::abs(before - fit.bic) < std::max(1.0, options.negligible_alignment_gain * excess(fit))) break;
  }
  return fit;
}

std::string SearchState::gapText(double squares) const {
  return formatted("gap %.4f", std::sqrt(squares / bench.samples()));
}

std::string describe(const Member& member) {
  std::string line = member.hypothesis->title() + ":";
  for (const auto& [key, value] : numbersOf(member.hypothesis->entry(member.values)))
    line += " " + key + formatted(" %.5g", value);
  return line;
}

}  // namespace smartmill::discrepancy
