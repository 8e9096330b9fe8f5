#include "search/candidate_round.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/search/evidence.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/start_values.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {

// A negligible share of the excess is not a missing effect.
CandidateRound::CandidateRound(SearchState& state)
    : state_(state),
      best_(state.now),
      required_gain_(std::max(state.options.min_gain, state.options.min_share * state.excess(state.now))) {
}

void CandidateRound::run(bool screened_again) {
  SearchState& s = state_;
  if (screened_again)
    s.screened = screen(s.quick, s.now, s.tangents, s.hypotheses, required_gain_, &s.memory);
  for (const PredictedGain& p : s.screened) {
    if (isRejected(p.hypothesis)) continue;
    if (s.bench.cancelled()) break;
    if (!isWorthFitting(p)) continue;
    fitHypothesis(p);
  }
  if (improved_) fitSimplerOnes();
  if (s.whole_records && !improved_) fitSupportedByTests();
}

bool CandidateRound::isRejected(const Hypothesis* hypothesis) const {
  return std::find(state_.rejected.begin(), state_.rejected.end(), hypothesis) != state_.rejected.end();
}

bool CandidateRound::isTried(const Hypothesis* hypothesis) const {
  return std::any_of(candidates_.begin(), candidates_.end(),
                     [&](const Candidate& r) { return r.hypothesis == hypothesis; });
}

bool CandidateRound::isWorthFitting(const PredictedGain& predicted) const {
  if (predicted.start.empty()) return false;
  if (predicted.gain < required_gain_ || candidates_.size() >= state_.options.fitted_per_round) return false;
  // A fit that leaves almost nothing can be surpassed only by a similar predicted gain, corrected by the
  // error of its own prediction.
  const double beyond = std::max(1.0, (state_.now.bic - best_.bic) / best_predicted_);
  return !(state_.excess(best_) < state_.options.almost_nothing * state_.excess(state_.now) &&
           beyond * predicted.gain < state_.options.similar * best_predicted_);
}

// Predicted gains are those of small changes. An effect that has the same radii in fewer values is compared
// whatever was predicted of it.
void CandidateRound::fitSimplerOnes() {
  const Member found = best_.state.members.back();
  for (const PredictedGain& p : state_.screened) {
    if (isTried(p.hypothesis) || isRejected(p.hypothesis) ||
        p.hypothesis->coordinates.size() >= found.values.size() || state_.bench.cancelled())
      continue;
    const std::optional<std::vector<double>> values = equivalentValues(state_.quick, found, *p.hypothesis);
    if (values) fitFrom(p, *values);
  }
}

// A small share of the whole excess may be all of it in the channels concerned: fits hypotheses that the
// fitted tests accept.
void CandidateRound::fitSupportedByTests() {
  SearchState& s = state_;
  screenRemembered(s.quick, s.now, s.tangents, s.options.min_gain, &s.memory, &s.screened);
  std::size_t fitted = 0;
  for (const PredictedGain& p : s.screened) {
    if (fitted >= state_.options.max_supported || p.gain < s.options.min_gain || s.bench.cancelled()) return;
    if (isTried(p.hypothesis) || isRejected(p.hypothesis) || p.start.empty() ||
        !ValidationResult::isAcceptedByFitted(fittedScale(s.quick, p)))
      continue;
    fitHypothesis(p);
    ++fitted;
  }
}

void CandidateRound::fitHypothesis(const PredictedGain& predicted) {
  std::optional<std::vector<double>> in_place;
  if (improved_) in_place = equivalentValues(state_.quick, best_.state.members.back(), *predicted.hypothesis);
  fitFrom(predicted, bestStart(state_.quick, state_.now, predicted, in_place));
}

void CandidateRound::fitFrom(const PredictedGain& predicted, const std::vector<double>& start) {
  SearchState& s = state_;
  FitState with = s.now.state;
  with.members.push_back({predicted.hypothesis, start});
  FitOptions options = FitOptions::toCompare();
  options.to_beat = std::min(best_.chi2 + best_.penalty, s.now.chi2 + s.now.penalty - required_gain_);
  FitResult tried;
  candidates_.push_back(fitCandidate(
      s.quick, predicted, s.rounds, s.now, [&] { return s.quick.fit(with, &s.tangents, options); }, &tried));
  s.options.log(formatted("  predicted gain %.4g, gain %.4g  ", predicted.gain, s.now.bic - tried.bic) +
                describe(tried.state.members.back()));
  if (!ranksAhead(tried) || !isImprovement(tried)) return;
  best_ = tried;
  best_predicted_ = predicted.gain;
  improved_ = true;
}

// Fits are not converged yet: of two similar ones the one with fewer values ranks ahead.
bool CandidateRound::ranksAhead(const FitResult& tried) const {
  const auto values = [](const FitResult& fit) { return fit.state.members.back().values.size(); };
  double margin = 0.0;
  if (improved_ && values(tried) != values(best_)) {
    const double negligible =
        state_.options.min_share * std::max(0.0, state_.excess(tried.bic < best_.bic ? tried : best_));
    margin = values(tried) < values(best_) ? negligible : -negligible;
  }
  return tried.bic < best_.bic + margin;
}

// A fit improves the model if it removes a large share of the excess or the fitted tests accept it; otherwise
// it imitates another effect.
bool CandidateRound::isImprovement(const FitResult& tried) const {
  if (!tried.converged) return false;
  const double gain = state_.now.bic - tried.bic;
  if (gain <= requiredGain(state_.quick.runner(), state_.now, tried, state_.options)) return false;
  return gain > state_.options.large_share * state_.excess(state_.now) ||
         ValidationResult::isAcceptedByFitted(fittedScale(state_.quick, tried, state_.now));
}

}  // namespace smartmill::discrepancy
