#include "smartmill_discrepancy/search/search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_discrepancy/search/evidence.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {
namespace {

std::string describe(const Member& m) {
  std::string line = m.hypothesis->title() + ":";
  for (const auto& [key, value] : numbersOf(m.hypothesis->entry(m.values)))
    line += " " + key + formatted(" %.5g", value);
  return line;
}

bool isMember(const FitState& state, const std::string& effect) {
  return std::any_of(state.members.begin(), state.members.end(),
                     [&](const Member& m) { return m.hypothesis->effect == effect; });
}

using PieceValues = std::map<std::string, std::vector<double>>;  // values by the name of a piece

// The form of an effect with exactly these pieces.
std::optional<Member> formOf(const std::string& effect, const PieceValues& pieces,
                             const std::vector<Hypothesis>& hypotheses) {
  for (const Hypothesis& h : hypotheses) {
    if (h.effect != effect || h.pieces.size() != pieces.size()) continue;
    if (!std::all_of(h.pieces.begin(), h.pieces.end(),
                     [&](const std::string& name) { return pieces.count(name) > 0; }))
      continue;
    Member one{&h, {}};
    for (const std::string& name : h.pieces) {
      const std::vector<double>& values = pieces.at(name);
      one.values.insert(one.values.end(), values.begin(), values.end());
    }
    return one;
  }
  return {};
}

// Merges separately found pieces of one effect (modes of the tool, axis by axis) into one member, with the
// newest values of each piece.
std::optional<FitState> mergedState(const FitState& state, const std::string& effect,
                                    const std::vector<Hypothesis>& hypotheses) {
  PieceValues pieces;
  FitState merged_state{state.nominal, {}, state.alignment};
  std::size_t members = 0;
  for (const Member& m : state.members) {
    if (m.hypothesis->effect != effect) {
      merged_state.members.push_back(m);
      continue;
    }
    ++members;
    for (std::size_t k = 0; k < m.hypothesis->pieces.size(); ++k)
      pieces[m.hypothesis->pieces[k]] = m.hypothesis->pieceOf(m.values, k);
  }
  if (members < 2) return {};
  const std::optional<Member> one = formOf(effect, pieces, hypotheses);
  if (!one) return {};
  merged_state.members.push_back(*one);
  return merged_state;
}

std::optional<FitState> withPiecesMerged(const FitState& state, const std::vector<Hypothesis>& hypotheses) {
  for (const Member& m : state.members) {
    if (m.hypothesis->pieces.empty()) continue;
    if (const auto one = mergedState(state, m.hypothesis->effect, hypotheses)) return one;
  }
  return {};
}

constexpr FitOptions CLOSELY{8, 1e-4, true};

class Search {
 public:
  Search(Workbench& bench, const std::vector<Hypothesis>& hypotheses, const SearchOptions& options)
      : bench_(bench), quick_(bench.quick()), hypotheses_(hypotheses), options_(options) {}

  /// Rounds on shortened records.
  void searchShortened();
  /// @param shortened search on shortened records whose result is continued; nullptr: none
  SearchResult run(const Search* shortened);

 private:
  // Fits of a round, with one more effect than before.
  struct Round {
    std::size_t number = 0;
    FitResult best;
    double best_predicted = 0.0;
    double required_gain = 0.0;   // minimum BIC gain
    std::size_t weak_fitted = 0;  // fitted weak hypotheses
    bool improved = false;        // best is a fit of this round
    std::vector<Candidate> candidates;
  };

  void fitNominal();
  void continueFrom(const Search& shortened);
  void limitGainsFrom(const Search& shortened);
  void reportProgress() const;
  void runRounds();
  void useStatedIfBetter();
  // @param give_up_above squares at which the fit ends
  void fitNominalFrom(const std::vector<double>& from,
                      double give_up_above = std::numeric_limits<double>::infinity());
  bool addEffect(std::size_t number);
  Round fitScreened(std::size_t number);
  void fitSupportedByTests(Round& round);
  bool isRejected(const Hypothesis* hypothesis) const {
    return std::find(rejected_.begin(), rejected_.end(), hypothesis) != rejected_.end();
  }
  bool isWeak(const Round& round, const PredictedGain& predicted) const;
  bool isWorthFitting(const Round& round, const PredictedGain& predicted, double largest) const;
  void fitHypothesis(const PredictedGain& predicted, Round& round);
  FitResult continued(FitResult tried, const FitOptions& options);
  bool ranksAhead(const FitResult& tried, const Round& round) const;
  bool isImprovement(const FitResult& tried) const;
  void acceptFit(FitResult best);
  void refitFromStated();
  void dropUnneeded();
  bool isSupportedByHeldout(const FitResult& before, const Hypothesis& newest);
  // Fit and derivatives at the start of a round.
  struct RoundStart {
    FitResult fit;
    NominalTangents tangents;
  };
  void revertTo(RoundStart start);
  void rejectEffect(RoundStart start, const Hypothesis* newest);
  void releaseGuidance();
  void finish();
  bool swapBetterAlternatives();

  FitState nearStated(const FitState& where) const;
  NominalTangents linearise(const FitState& where) { return bench_.linearise(nearStated(where)); }
  FitResult refit(const FitResult& from, const FitOptions& options) const;
  FitResult withPhasesAligned(FitResult fit);
  // Squares above the noise.
  double excess(const FitResult& fit) const { return fit.chi2 - bench_.samples(); }
  std::string gapText(double squares) const {
    return formatted("gap %.4f", std::sqrt(squares / bench_.samples()));
  }

  Workbench& bench_;
  const Fitter& quick_;
  const std::vector<Hypothesis>& hypotheses_;
  const SearchOptions& options_;
  NominalTangents tangents_;
  FitResult now_;
  double exact_now_ = 0.0;  // squares of the exact twin
  std::vector<const Hypothesis*> rejected_;
  ScreeningMemory memory_;
  std::vector<PredictedGain> screened_;  // predictions of the last round
  bool reverted_ = false;                // to the start of the last round
  std::size_t uncounted_rounds_ = 0;     // not counted in max_effects
  std::size_t rejections_in_a_row_ = 0;  // consecutive
  std::size_t rounds_ = 0;
  bool whole_records_ = false;  // not shortened
  SearchResult result_;
};

// Nominal values are pulled away by missing effects; derivatives are taken within the range of their stated
// values.
FitState Search::nearStated(const FitState& where) const {
  constexpr double NEAR = 2.5;  // standard deviations
  FitState at = where;
  const std::vector<Coordinate>& free = bench_.freedom().coordinates();
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double reach = NEAR * free[c].prior_std;
    at.nominal[c] = std::clamp(at.nominal[c], free[c].null - reach, free[c].null + reach);
  }
  return at;
}

// Keeps the fit if the twin gives no finite values.
FitResult Search::refit(const FitResult& from, const FitOptions& options) const {
  FitResult fit = quick_.fit(from.state, &tangents_, options);
  return fit.converged ? fit : from;
}

FitResult Search::withPhasesAligned(FitResult fit) {
  constexpr int PASSES = 4;
  constexpr double LARGE_ROTATION = 0.1;  // [rad] that invalidates remembered derivatives
  for (int pass = 0; pass < PASSES && bench_.phasesEstimated() && !bench_.cancelled(); ++pass) {
    const double rotation = bench_.alignPhases(fit.state);
    if (rotation == 0.0) break;
    if (rotation > LARGE_ROTATION) memory_.clear();
    tangents_ = linearise(fit.state);
    const double before = fit.bic;
    fit = refit(fit, {8, 1e-4, true});
    if (std::abs(before - fit.bic) < std::max(1.0, 0.01 * excess(fit))) break;
  }
  return fit;
}

void Search::fitNominalFrom(const std::vector<double>& from, double give_up_above) {
  constexpr int FRESH = 2;
  now_ = FitResult{};
  now_.state.nominal = from;
  // Distant nominal values require new derivatives at each iterate. Alignment is sensitive to the nominal
  // values, so it needs tighter convergence.
  const int passes = bench_.phasesEstimated() ? 8 : 3;
  const double share = bench_.phasesEstimated() ? 1e-6 : 1e-3;  // of the cost: maximum gain of the last pass
  bool settled = false;
  for (int pass = 0; pass < passes; ++pass) {
    bench_.updateWeights(nearStated(now_.state));
    // Later passes are close to each other and reuse the derivatives.
    tangents_ = pass < FRESH ? linearise(now_.state)
                             : bench_.lineariseBy(std::move(tangents_), nearStated(now_.state));
    FitResult fit = quick_.fit(now_.state, &tangents_, {8, 1e-5, true});
    if (!fit.converged && pass == 0)
      throw Error(bench_.data().campaign.folder + ": the twin gives no finite values for the nominal model");
    if (!fit.converged) break;
    settled = pass > 0 && std::abs(now_.bic - fit.bic) < std::max(1.0, share * fit.bic);
    now_ = std::move(fit);
    if (now_.chi2 > give_up_above) return;
    if (settled || bench_.cancelled()) break;
  }
  tangents_ = settled && !bench_.phasesEstimated()
                  ? bench_.lineariseBy(std::move(tangents_), nearStated(now_.state))
                  : linearise(now_.state);
  now_ = withPhasesAligned(refit(now_, {3, 1e-5, true}));
  useStatedIfBetter();
  result_.null = now_;
  options_.log("nominal model, values free within their uncertainty: " + gapText(now_.chi2));
  // The quick twin may differ from the exact one away from its correction: near the stability limit only one
  // of them may vibrate.
  exact_now_ = bench_.exactSquares(now_.state);
}

// Returns to the stated values if the fit moved to values at which the tool chatters.
void Search::useStatedIfBetter() {
  FitState stated = now_.state;
  stated.nominal.assign(stated.nominal.size(), 0.0);
  if (!(bench_.exactSquares(stated) < now_.chi2)) return;
  tangents_ = linearise(stated);
  now_ = quick_.fit(stated, &tangents_, {0, 1e-8, true});
}

void Search::fitNominal() {
  const std::vector<double> stated(bench_.freedom().coordinates().size(), 0.0);
  fitNominalFrom(stated);
  if (!bench_.canGuide() || excess(now_) < 0.02 * bench_.samples() || bench_.cancelled()) return;
  constexpr double GIVE_UP_RATIO = 4.0;  // squares of the first pass over those of the free fit
  const FitResult free = now_;
  NominalTangents free_tangents = std::move(tangents_);
  bench_.setGuided(true);
  fitNominalFrom(stated, GIVE_UP_RATIO * free.chi2);
  if (now_.chi2 < free.chi2) {
    options_.log("  guided by the displacement of the tool");
    return;
  }
  bench_.setGuided(false);
  now_ = result_.null = free;
  tangents_ = bench_.lineariseBy(std::move(free_tangents), nearStated(now_.state));
  exact_now_ = bench_.exactSquares(now_.state);
}

// Weak hypotheses may gain more than predicted, unless nominal values can replace them; they are fitted if no
// strong one removes much.
bool Search::isWeak(const Round& round, const PredictedGain& predicted) const {
  constexpr double MIN_INDEPENDENT = 0.02, WEAK = 0.25;
  constexpr double MOST = 0.9;  // [1] of the excess that the best fit leaves
  return whole_records_ && excess(round.best) > MOST * excess(now_) && predicted.gain < round.required_gain &&
         predicted.gain > WEAK * round.required_gain && predicted.independent_share > MIN_INDEPENDENT;
}

bool Search::isWorthFitting(const Round& round, const PredictedGain& predicted, double largest) const {
  if (predicted.start.empty()) return false;
  constexpr std::size_t MAX_WEAK = 2;
  const std::size_t fitted = round.candidates.size();
  const bool weak = isWeak(round, predicted);
  if (predicted.gain < round.required_gain && !weak) return false;
  if (weak ? round.weak_fitted >= MAX_WEAK : fitted - round.weak_fitted >= options_.fitted_per_round)
    return false;
  if (fitted >= 2 && predicted.gain < 0.02 * largest) return false;
  // A fit that leaves almost nothing can be surpassed only by a similar predicted gain, corrected by the
  // error of its own prediction.
  const double beyond = std::max(1.0, (now_.bic - round.best.bic) / round.best_predicted);
  return !(excess(round.best) < 0.02 * excess(now_) && beyond * predicted.gain < 0.5 * round.best_predicted);
}

// Fits are not converged yet: of two similar ones the one with fewer values ranks ahead.
bool Search::ranksAhead(const FitResult& tried, const Round& round) const {
  const auto values = [](const FitResult& fit) { return fit.state.members.back().values.size(); };
  double margin = 0.0;
  if (round.improved && values(tried) != values(round.best)) {
    const double negligible =
        options_.min_share * std::max(0.0, excess(tried.bic < round.best.bic ? tried : round.best));
    margin = values(tried) < values(round.best) ? negligible : -negligible;
  }
  return tried.bic < round.best.bic + margin;
}

// Continues a fit with the twin corrected at its end if the gain is too small for an improvement but the
// tests prefer a larger scale.
FitResult Search::continued(FitResult tried, const FitOptions& options) {
  constexpr double MIN_SCALE = 1.25, MIN_GAIN_SHARE = 0.1;  // [1] effect scale; gain over the excess
  if (!tried.converged || now_.bic - tried.bic < MIN_GAIN_SHARE * excess(now_) || isImprovement(tried))
    return tried;
  if (fittedScale(quick_, tried, now_).scale < MIN_SCALE) return tried;
  NominalTangents there = bench_.lineariseBy(tangents_, nearStated(tried.state));
  FitResult on = quick_.fit(tried.state, &there, options);
  bench_.lineariseBy(std::move(there),
                     nearStated(now_.state));  // the other candidates of the round are compared as before
  return on.converged && on.bic < tried.bic ? on : tried;
}

void Search::fitHypothesis(const PredictedGain& predicted, Round& round) {
  FitState with = now_.state;
  std::optional<std::vector<double>> in_place;
  if (round.improved)
    in_place = equivalentValues(quick_, round.best.state.members.back(), *predicted.hypothesis);
  with.members.push_back({predicted.hypothesis, bestStart(quick_, now_, predicted, in_place)});
  FitOptions options{6, 1e-3, true};
  options.to_beat =
      std::min(round.best.chi2 + round.best.penalty, now_.chi2 + now_.penalty - round.required_gain);
  FitResult tried;
  round.candidates.push_back(fitCandidate(
      quick_, predicted, round.number, now_,
      [&] { return continued(quick_.fit(with, &tangents_, options), options); }, &tried));
  options_.log(formatted("  predicted gain %.4g, gain %.4g  ", predicted.gain, now_.bic - tried.bic) +
               describe(tried.state.members.back()));
  if (ranksAhead(tried, round) && isImprovement(tried)) {
    round.best = tried;
    round.best_predicted = predicted.gain;
    round.improved = true;
  }
}

Search::Round Search::fitScreened(std::size_t number) {
  Round round;
  round.number = number;
  round.best = now_;
  // A negligible share of the excess is not a missing effect.
  round.required_gain = std::max(options_.min_gain, options_.min_share * excess(now_));
  if (!reverted_) screened_ = screen(quick_, now_, tangents_, hypotheses_, round.required_gain, &memory_);
  reverted_ = false;
  for (const PredictedGain& p : screened_) {
    if (isRejected(p.hypothesis)) continue;
    if (bench_.cancelled()) break;
    if (!isWorthFitting(round, p, screened_.front().gain)) continue;
    if (isWeak(round, p)) ++round.weak_fitted;
    fitHypothesis(p, round);
  }
  if (whole_records_ && !round.improved) fitSupportedByTests(round);
  return round;
}

// A small share of the whole excess may be all of it in the channels concerned: fits hypotheses that the
// fitted tests accept.
void Search::fitSupportedByTests(Round& round) {
  constexpr std::size_t MOST = 2;
  screenRemembered(quick_, now_, tangents_, options_.min_gain, &memory_, &screened_);
  std::size_t fitted = 0;
  for (const PredictedGain& p : screened_) {
    if (fitted >= MOST || p.gain < options_.min_gain || bench_.cancelled()) return;
    const bool tried = std::any_of(round.candidates.begin(), round.candidates.end(),
                                   [&](const Candidate& r) { return r.hypothesis == p.hypothesis; });
    if (tried || isRejected(p.hypothesis) || p.start.empty() ||
        !ValidationResult::isAcceptedByFitted(fittedScale(quick_, p)))
      continue;
    fitHypothesis(p, round);
    ++fitted;
  }
}

// A fit improves the model if it removes a large share of the excess or the fitted tests accept it; otherwise
// it imitates another effect.
bool Search::isImprovement(const FitResult& tried) const {
  constexpr double LARGE_SHARE = 0.25;  // [1] of the excess
  if (!tried.converged) return false;
  const double gain = now_.bic - tried.bic;
  if (gain <= requiredGain(quick_.runner(), now_, tried, options_)) return false;
  return gain > LARGE_SHARE * excess(now_) ||
         ValidationResult::isAcceptedByFitted(fittedScale(quick_, tried, now_));
}

// Adopts the best fit of a round and refits everything until a pass gains less than an effect must; a
// remaining gain would imitate another effect.
void Search::acceptFit(FitResult best) {
  constexpr int PASSES = 4;
  tangents_ = linearise(best.state);
  if (const auto one = withPiecesMerged(best.state, hypotheses_)) {
    FitResult merged_state = quick_.fit(*one, &tangents_, CLOSELY);
    if (merged_state.bic < best.bic) {
      best = std::move(merged_state);
      tangents_ = linearise(best.state);
    }
  }
  const FitResult refined = refit(best, CLOSELY);
  // Derivatives are valid near the start of the fit.
  constexpr double FAR = 0.01;  // [1] of the squares
  tangents_ = best.bic - refined.bic > FAR * refined.bic
                  ? linearise(refined.state)
                  : bench_.lineariseBy(std::move(tangents_), nearStated(refined.state));
  now_ = withPhasesAligned(refit(refined, CLOSELY));
  refitFromStated();
  for (int pass = 0; pass < PASSES; ++pass) {
    tangents_ = bench_.lineariseBy(std::move(tangents_), nearStated(now_.state));
    if (bench_.cancelled()) break;
    const double before = now_.bic;
    now_ = refit(now_, CLOSELY);
    if (before - now_.bic < std::max(options_.min_gain, options_.min_share * excess(now_))) break;
  }
}

// An effect fitted next to strongly displaced nominal values may be in a wrong valley: fits it with stated
// values, then with all values free. The quick twin remains corrected at the last state.
void Search::refitFromStated() {
  constexpr double GIVE_UP_RATIO = 2.0;  // squares over the current ones
  if (nearStated(now_.state).nominal == now_.state.nominal) return;
  FitState stated = now_.state;
  stated.nominal.assign(stated.nominal.size(), 0.0);
  const FitResult at_stated = quick_.fit(stated, nullptr, {8, 1e-4, false});
  if (!at_stated.converged || at_stated.chi2 > GIVE_UP_RATIO * now_.chi2) return;
  NominalTangents tangents = linearise(at_stated.state);
  FitResult free = quick_.fit(at_stated.state, &tangents, CLOSELY);
  if (!free.converged || free.bic >= now_.bic) return;
  tangents_ = bench_.lineariseBy(std::move(tangents), nearStated(free.state));
  now_ = withPhasesAligned(refit(free, CLOSELY));
}

// Earlier effects may have imitated the new one.
void Search::dropUnneeded() {
  for (std::size_t m = 0; m < now_.state.members.size() && now_.state.members.size() > 1;) {
    FitResult less = quick_.fit(without(now_.state, m), &tangents_, {6, 1e-3, true});
    if (!isSignificant(quick_.runner(), less, now_, options_)) {
      options_.log("  no longer needed: " + now_.state.members[m].hypothesis->title());
      now_ = std::move(less);
    } else {
      ++m;
    }
  }
}

// An effect that does not reduce the gap of held-out tests imitates another one.
bool Search::isSupportedByHeldout(const FitResult& before, const Hypothesis& newest) {
  bench_.alignTo(now_.state);
  const EffectScale scale = validate(bench_, now_.state, before.state).heldout;
  if (!ValidationResult::isRejected(scale)) return true;
  options_.log(
      formatted("effect scale of the held-out tests %.2g +- %.2g, rejected: ", scale.scale, scale.std_dev) +
      newest.title());
  return false;
}

void Search::revertTo(RoundStart start) {
  ++uncounted_rounds_;
  now_ = std::move(start.fit);
  const bool realigned = bench_.alignPhases(now_.state) > 0.0;
  tangents_ = realigned ? linearise(now_.state)
                        : bench_.lineariseBy(std::move(start.tangents), nearStated(now_.state));
  now_ = refit(now_, {8, 1e-4, true});
  exact_now_ = bench_.exactSquares(now_.state);
}

void Search::rejectEffect(RoundStart start, const Hypothesis* newest) {
  ++rejections_in_a_row_;
  rejected_.push_back(newest);
  revertTo(std::move(start));
  reverted_ = true;
}

// @return false: the search ends
bool Search::addEffect(std::size_t number) {
  constexpr std::size_t MAX_REJECTIONS = 3;
  Round round = fitScreened(number);
  const bool improved = round.improved && !bench_.cancelled();
  const Hypothesis* const newest = improved ? round.best.state.members.back().hypothesis : nullptr;
  const std::size_t first = result_.candidates.size();
  result_.candidates.insert(result_.candidates.end(), round.candidates.begin(), round.candidates.end());
  if (!improved) return false;
  RoundStart before{now_, std::move(tangents_)};
  acceptFit(std::move(round.best));
  dropUnneeded();
  const double exact_squares = bench_.exactSquares(now_.state);
  if (!(exact_squares < exact_now_)) {
    options_.log(gapText(exact_squares) + " when simulated exactly, rejected: " + newest->title());
    // An effect already dropped as unnecessary needs no smaller steps.
    if (isMember(now_.state, newest->effect) && bench_.refineQuick()) {
      options_.log("  repeated with smaller steps");
      memory_.clear();
      revertTo(std::move(before));
    } else {
      rejectEffect(std::move(before), newest);
    }
    return true;
  }
  if (!isSupportedByHeldout(before.fit, *newest)) {
    if (std::find(result_.rejected.begin(), result_.rejected.end(), newest) == result_.rejected.end())
      result_.rejected.push_back(newest);
    rejectEffect(std::move(before), newest);
    return rejections_in_a_row_ < MAX_REJECTIONS;
  }
  rejections_in_a_row_ = 0;
  rejected_.clear();  // they were rejected without the new effect
  auto& rejected_by_heldout = result_.rejected;
  rejected_by_heldout.erase(std::remove(rejected_by_heldout.begin(), rejected_by_heldout.end(), newest),
                            rejected_by_heldout.end());
  for (std::size_t k = first; k < result_.candidates.size(); ++k)
    result_.candidates[k].result.accepted = result_.candidates[k].hypothesis == newest;
  exact_now_ = exact_squares;
  options_.log(gapText(now_.chi2) + " with " + describe(now_.state.members.back()));
  return true;
}

void Search::finish() {
  bench_.guideNearLimit(now_.state);
  bench_.updateWeights(now_.state);
  result_.best = now_;
  bool refined = refine(bench_, now_.state, options_, &result_);
  // Effects may become unnecessary after the refinement.
  while (refined && !result_.contribution.empty()) {
    const auto least = std::min_element(result_.contribution.begin(), result_.contribution.end());
    const auto m = static_cast<std::size_t>(least - result_.contribution.begin());
    if (result_.is_needed[m]) break;
    options_.log("  no longer needed: " + result_.best.state.members[m].hypothesis->title());
    refined = refine(bench_, without(result_.best.state, m), options_, &result_);
  }
  if (refined) refined = swapBetterAlternatives();
  if (!refined) result_.clearMembers();
  for (const Member& m : result_.best.state.members) options_.log("found " + describe(m));
}

// Candidates of a round are compared before convergence; compares their refined fits.
// @return false: the twin gives no finite values
bool Search::swapBetterAlternatives() {
  constexpr int SWAPS = 3;
  for (int swap = 0; swap < SWAPS && !bench_.cancelled(); ++swap) {
    const auto ahead = [&](const Alternative& r) { return r.delta_bic - result_.contribution[r.member]; };
    const auto best =
        std::max_element(result_.alternatives.begin(), result_.alternatives.end(),
                         [&](const Alternative& a, const Alternative& b) { return ahead(a) < ahead(b); });
    if (best == result_.alternatives.end() || ahead(*best) <= 0.0) return true;
    const Hypothesis& old = *result_.best.state.members[best->member].hypothesis;
    const Hypothesis& improved = *best->state.members.back().hypothesis;
    options_.log("  replaced: " + old.title() + " by " + improved.title());
    result_.markReplaced(old, improved);
    const FitState state = best->state;
    if (!refine(bench_, state, options_, &result_)) return false;
  }
  return true;
}

// Ends the guidance if the free simulation follows the records.
void Search::releaseGuidance() {
  constexpr double MAX_RATIO = 2.0;  // free over guided squares
  refitSimplerAlternatives(quick_, now_, tangents_, &result_.candidates);
  const double guided = bench_.exactSquares(now_.state), free = bench_.freeSquares(now_.state);
  options_.log("guided by the tool's displacement " + gapText(guided) + ", simulated freely " +
               gapText(free));
  if (free < MAX_RATIO * guided) bench_.setGuided(false);
}

// Work in units of a nominal fit, from typical campaigns.
void Search::reportProgress() const {
  constexpr double ROUND = 2.0, LAST_ROUND = 1.0, WHOLE = 2.0, AFTER = 4.0;
  const double done = 1.0 + ROUND * static_cast<double>(rounds_) + (whole_records_ ? WHOLE : 0.0);
  const double left = AFTER + LAST_ROUND + (whole_records_ ? 0.0 : WHOLE);
  options_.reportProgress(done / (done + left));
}

void Search::runRounds() {
  reportProgress();
  while (rounds_ < options_.max_effects + uncounted_rounds_ && !bench_.cancelled()) {
    if (!addEffect(rounds_++)) break;
    reportProgress();
  }
}

// Continues a search on shortened records with the whole records.
void Search::continueFrom(const Search& shortened) {
  options_.log("search on whole records");
  bench_.setGuided(shortened.bench_.guided());
  fitNominalFrom(shortened.result_.null.state.nominal);
  result_.candidates = shortened.result_.candidates;
  result_.rejected = shortened.result_.rejected;
  rejected_ = shortened.rejected_;
  rounds_ = shortened.rounds_;
  uncounted_rounds_ = shortened.uncounted_rounds_ + 1;  // one round to confirm the result
  if (shortened.now_.state.members.empty()) {
    limitGainsFrom(shortened);
    return;
  }
  const FitResult null = now_;
  FitResult start = null;
  start.state = shortened.now_.state;
  acceptFit(start);
  const double exact_squares = bench_.exactSquares(now_.state);
  if (exact_squares < exact_now_) {
    exact_now_ = exact_squares;
    limitGainsFrom(shortened);
    return;
  }
  now_ = null;
  tangents_ = linearise(now_.state);
}

// Limits the gains on whole records by the last screening of the shortened ones if both are nearly explained:
// squares grow with the samples, those of effects that grow in time with their third power.
void Search::limitGainsFrom(const Search& shortened) {
  constexpr double NEGLIGIBLE = 0.02;       // [1] of the squares of the noise
  constexpr double WORTH_SCREENING = 0.25;  // of the required gain
  const auto is_explained = [&](const Search& s) {
    return s.excess(s.now_) < NEGLIGIBLE * s.bench_.samples();
  };
  if (!is_explained(shortened) || !is_explained(*this)) return;
  const double longer = bench_.samples() / shortened.bench_.samples();
  for (const PredictedGain& p : shortened.screened_)
    memory_.gain_limits[p.hypothesis] = p.gain * std::max(std::pow(longer, 3), longer / WORTH_SCREENING);
}

void Search::searchShortened() {
  fitNominal();
  runRounds();
}

SearchResult Search::run(const Search* shortened) {
  whole_records_ = true;
  if (shortened) {
    continueFrom(*shortened);
  } else {
    fitNominal();
  }
  runRounds();
  if (bench_.guided()) releaseGuidance();
  finish();
  return std::move(result_);
}

}  // namespace

void SearchResult::markReplaced(const Hypothesis& old, const Hypothesis& improved) {
  for (Candidate& r : candidates) {
    if (r.result.effect == old.effect && r.result.variant == old.variant) r.result.accepted = false;
    if (r.result.effect == improved.effect && r.result.variant == improved.variant) r.result.accepted = true;
  }
}

SearchResult search(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                    const SearchOptions& options) {
  const MachineModel& nominal = bench.data().nominal;
  const std::optional<Dataset> short_data =
      hasToolModes(nominal) ? shortenedDataset(bench.data()) : std::nullopt;
  if (!short_data) return Search(bench, hypotheses, options).run(nullptr);
  Workbench shortened_bench(*short_data, bench.options());
  Search shortened(shortened_bench, hypotheses, options);
  shortened.searchShortened();
  return Search(bench, hypotheses, options).run(&shortened);
}

}  // namespace smartmill::discrepancy
