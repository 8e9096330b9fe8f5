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
#include "smartmill_discrepancy/search/standing.h"

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

using Pieces = std::map<std::string, std::vector<double>>;  // values by the name of a piece

// The form of an effect that is put together of just these pieces, with their values.
std::optional<Member> formOf(const std::string& effect, const Pieces& pieces,
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

// A piece of an effect found beside the same piece may be what the other stood for, and pieces found one by
// one are one effect (modes of the tool, axis by axis): the state with the newest of each piece in one
// member.
std::optional<FitState> joined(const FitState& state, const std::string& effect,
                               const std::vector<Hypothesis>& hypotheses) {
  Pieces pieces;
  FitState merged{state.nominal, {}, state.turns};
  std::size_t members = 0;
  for (const Member& m : state.members) {
    if (m.hypothesis->effect != effect) {
      merged.members.push_back(m);
      continue;
    }
    ++members;
    for (std::size_t k = 0; k < m.hypothesis->pieces.size(); ++k)
      pieces[m.hypothesis->pieces[k]] = m.hypothesis->pieceOf(m.values, k);
  }
  if (members < 2) return {};
  const std::optional<Member> one = formOf(effect, pieces, hypotheses);
  if (!one) return {};
  merged.members.push_back(*one);
  return merged;
}

std::optional<FitState> withPiecesJoined(const FitState& state, const std::vector<Hypothesis>& hypotheses) {
  for (const Member& m : state.members) {
    if (m.hypothesis->pieces.empty()) continue;
    if (const auto one = joined(state, m.hypothesis->effect, hypotheses)) return one;
  }
  return {};
}

constexpr FitOptions CLOSELY{8, 1e-4, true};

class Search {
 public:
  Search(Workbench& bench, const std::vector<Hypothesis>& hypotheses, const SearchOptions& options)
      : bench_(bench), quick_(bench.quick()), hypotheses_(hypotheses), options_(options) {}

  /// Rounds until nothing more is found.
  void look();
  /// @param brief that has looked at less of the same records; nullptr: none
  SearchResult run(const Search* brief);

 private:
  // A round's fits, one effect more than before.
  struct Round {
    std::size_t number = 0;
    Fit best;
    double best_promise = 0.0;
    double least = 0.0;     // gain of BIC that an effect must bring
    std::size_t hints = 0;  // fitted on a hint
    bool better = false;    // best is one of its fits
    std::vector<Rung> rungs;
  };

  void fitNominal();
  void beginFrom(const Search& brief);
  void takePromises(const Search& brief);
  void tellCourse() const;
  void rounds();
  void keepStatedWhereBetter();
  // @param hopeless squares above which it is given up
  void fitNominalHere(const std::vector<double>& from,
                      double hopeless = std::numeric_limits<double>::infinity());
  bool addEffect(std::size_t number);
  Round fitPromises(std::size_t number);
  void fitStanding(Round& round);
  bool isRefused(const Hypothesis* hypothesis) const {
    return std::find(refused_.begin(), refused_.end(), hypothesis) != refused_.end();
  }
  bool isHint(const Round& round, const Promise& promise) const;
  bool worthFitting(const Round& round, const Promise& promise, double largest) const;
  void fitPromise(const Promise& promise, Round& round);
  Fit followed(Fit tried, const FitOptions& options);
  bool isAhead(const Fit& tried, const Round& round) const;
  bool isBetter(const Fit& tried) const;
  void settle(Fit best);
  void settleFromStated();
  void dropNeedless();
  bool helpsElsewhere(const Fit& before, const Hypothesis& newest);
  // Where a round began.
  struct Begin {
    Fit fit;
    NominalTangents tangents;
  };
  void stepBack(Begin begin);
  void refuse(Begin begin, const Hypothesis* newest);
  void letGo();
  void finish();
  bool takeBetterRivals();

  FitState near(const FitState& where) const;
  NominalTangents linearise(const FitState& where) { return bench_.linearise(near(where)); }
  Fit refit(const Fit& from, const FitOptions& options) const;
  Fit withPhasesTurned(Fit fit);
  // Squares above the noise.
  double excess(const Fit& fit) const { return fit.chi2 - bench_.samples(); }
  std::string gapText(double squares) const {
    return formatted("gap %.4f", std::sqrt(squares / bench_.samples()));
  }

  Workbench& bench_;
  const Fitter& quick_;
  const std::vector<Hypothesis>& hypotheses_;
  const SearchOptions& options_;
  NominalTangents tangents_;
  Fit now_;
  double exact_now_ = 0.0;  // squares that the exact twin leaves
  std::vector<const Hypothesis*> refused_;
  ScreeningMemory screened_;
  std::vector<Promise> promises_;  // of the last round
  bool stepped_back_ = false;      // to where they were made
  std::size_t repeated_ = 0;       // rounds that did not count
  std::size_t in_vain_ = 0;        // of them one after the other
  std::size_t rounds_ = 0;
  bool all_ = false;  // of the records are looked at
  SearchResult result_;
};

// What is missing pulls the nominal values far away, but they belong near to what is stated: there the
// tangents are taken.
FitState Search::near(const FitState& where) const {
  constexpr double NEAR = 2.5;  // standard deviations
  FitState at = where;
  const std::vector<Coordinate>& free = bench_.freedom().coordinates();
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double reach = NEAR * free[c].prior_std;
    at.nominal[c] = std::clamp(at.nominal[c], free[c].null - reach, free[c].null + reach);
  }
  return at;
}

// Where the twin gives no numbers the fit stays what it was.
Fit Search::refit(const Fit& from, const FitOptions& options) const {
  Fit fit = quick_.fit(from.state, &tangents_, options);
  return fit.converged ? fit : from;
}

Fit Search::withPhasesTurned(Fit fit) {
  constexpr int PASSES = 4;
  constexpr double ANOTHER = 0.1;  // [rad] where everything looks otherwise
  for (int pass = 0; pass < PASSES && bench_.phasesEstimated() && !bench_.cancelled(); ++pass) {
    const double turn = bench_.turnPhases(fit.state);
    if (turn == 0.0) break;
    if (turn > ANOTHER) screened_.clear();
    tangents_ = linearise(fit.state);
    const double before = fit.bic;
    fit = refit(fit, {8, 1e-4, true});
    if (std::abs(before - fit.bic) < std::max(1.0, 0.01 * excess(fit))) break;
  }
  return fit;
}

void Search::fitNominalHere(const std::vector<double>& from, double hopeless) {
  constexpr int FRESH = 2;
  now_ = Fit{};
  now_.state.nominal = from;
  // Nominal values that are off far: tangents are taken anew where the fit went. Where records lie is told
  // from what the nominal values do to their last noise.
  const int passes = bench_.phasesEstimated() ? 8 : 3;
  const double share =
      bench_.phasesEstimated() ? 1e-6 : 1e-3;  // of the cost, by which the last pass may gain
  bool settled = false;
  for (int pass = 0; pass < passes; ++pass) {
    bench_.trustAt(near(now_.state));
    // Where the first passes went the tangents are much alike.
    tangents_ =
        pass < FRESH ? linearise(now_.state) : bench_.lineariseBy(std::move(tangents_), near(now_.state));
    Fit fit = quick_.fit(now_.state, &tangents_, {8, 1e-5, true});
    if (!fit.converged && pass == 0)
      throw Error(bench_.data().campaign.folder + ": the twin gives no numbers for the nominal model");
    if (!fit.converged) break;
    settled = pass > 0 && std::abs(now_.bic - fit.bic) < std::max(1.0, share * fit.bic);
    now_ = std::move(fit);
    if (now_.chi2 > hopeless) return;
    if (settled || bench_.cancelled()) break;
  }
  tangents_ = settled && !bench_.phasesEstimated()
                  ? bench_.lineariseBy(std::move(tangents_), near(now_.state))
                  : linearise(now_.state);
  now_ = withPhasesTurned(refit(now_, {3, 1e-5, true}));
  keepStatedWhereBetter();
  result_.null = now_;
  options_.say("nominal model, values free within their uncertainty: " + gapText(now_.chi2));
  // The quick twin may lie far from where it was corrected: near its stability limit a tool vibrates in it
  // that is quiet in the exact one, or the reverse.
  exact_now_ = bench_.exactSquares(now_.state);
}

// A tool with modes is guided by its displacement where that leaves less than the free simulation, which may
// have run away; a displacement that is measured wrongly guides no better.
// What is missing may pull the values to where the tool chatters.
void Search::keepStatedWhereBetter() {
  FitState stated = now_.state;
  stated.nominal.assign(stated.nominal.size(), 0.0);
  if (!(bench_.exactSquares(stated) < now_.chi2)) return;
  tangents_ = linearise(stated);
  now_ = quick_.fit(stated, &tangents_, {0, 1e-8, true});
}

void Search::fitNominal() {
  const std::vector<double> stated(bench_.freedom().coordinates().size(), 0.0);
  fitNominalHere(stated);
  if (!bench_.canGuide() || excess(now_) < 0.02 * bench_.samples() || bench_.cancelled()) return;
  constexpr double HOPELESS = 4.0;  // times the squares of the free one, left by the first pass
  const Fit free = now_;
  NominalTangents free_tangents = std::move(tangents_);
  bench_.guide(true);
  fitNominalHere(stated, HOPELESS * free.chi2);
  if (now_.chi2 < free.chi2) {
    options_.say("  guided by the displacement of the tool");
    return;
  }
  bench_.guide(false);
  now_ = result_.null = free;
  tangents_ = bench_.lineariseBy(std::move(free_tangents), near(now_.state));
  exact_now_ = bench_.exactSquares(now_.state);
}

// Where nothing that promises outright takes much, what promises nearly enough may be more than tangents say,
// unless nominal values stand for it.
bool Search::isHint(const Round& round, const Promise& promise) const {
  constexpr double APART = 0.02, HINT = 0.25;
  constexpr double MOST = 0.9;  // of the excess is left by what promised outright
  return all_ && excess(round.best) > MOST * excess(now_) && promise.gain < round.least &&
         promise.gain > HINT * round.least && promise.apart > APART;
}

bool Search::worthFitting(const Round& round, const Promise& promise, double largest) const {
  if (promise.start.empty()) return false;
  constexpr std::size_t MOST_HINTS = 2;
  const std::size_t fitted = round.rungs.size();
  const bool hint = isHint(round, promise);
  if (promise.gain < round.least && !hint) return false;
  if (hint ? round.hints >= MOST_HINTS : fitted - round.hints >= options_.fitted_per_round) return false;
  if (fitted >= 2 && promise.gain < 0.02 * largest) return false;
  // One that leaves next to nothing can be bettered only by one that promises about as much, as far as
  // promises hold: the best one's own was short by this.
  const double beyond = std::max(1.0, (now_.bic - round.best.bic) / round.best_promise);
  return !(excess(round.best) < 0.02 * excess(now_) && beyond * promise.gain < 0.5 * round.best_promise);
}

// None has settled yet: of two that differ by a trifle the one with less values.
bool Search::isAhead(const Fit& tried, const Round& round) const {
  const auto values = [](const Fit& fit) { return fit.state.members.back().values.size(); };
  double margin = 0.0;
  if (round.better && values(tried) != values(round.best)) {
    const double trifle =
        options_.least_share * std::max(0.0, excess(tried.bic < round.best.bic ? tried : round.best));
    margin = values(tried) < values(round.best) ? trifle : -trifle;
  }
  return tried.bic < round.best.bic + margin;
}

// The quick twin is the exact one where the round began: where a fit takes too little to be better, and the
// tests ask for still more of what it found, it goes on with the twin corrected there.
Fit Search::followed(Fit tried, const FitOptions& options) {
  constexpr double MORE = 1.25, WORTH = 0.1;  // [1] of it, of what is left
  if (!tried.converged || now_.bic - tried.bic < WORTH * excess(now_) || isBetter(tried)) return tried;
  if (fittedShare(quick_, tried, now_).share < MORE) return tried;
  NominalTangents there = bench_.lineariseBy(tangents_, near(tried.state));
  Fit on = quick_.fit(tried.state, &there, options);
  bench_.lineariseBy(std::move(there), near(now_.state));  // the others of the round are compared as before
  return on.converged && on.bic < tried.bic ? on : tried;
}

void Search::fitPromise(const Promise& promise, Round& round) {
  FitState with = now_.state;
  std::optional<std::vector<double>> in_place;
  if (round.better) in_place = inPlaceOf(quick_, round.best.state.members.back(), *promise.hypothesis);
  with.members.push_back({promise.hypothesis, bestStart(quick_, now_, promise, in_place)});
  FitOptions options{6, 1e-3, true};
  options.to_beat = std::min(round.best.chi2 + round.best.penalty, now_.chi2 + now_.penalty - round.least);
  Fit tried;
  round.rungs.push_back(rungOf(
      quick_, promise, round.number, now_,
      [&] { return followed(quick_.fit(with, &tangents_, options), options); }, &tried));
  options_.say(formatted("  promise %.4g, gain %.4g  ", promise.gain, now_.bic - tried.bic) +
               describe(tried.state.members.back()));
  if (isAhead(tried, round) && isBetter(tried)) {
    round.best = tried;
    round.best_promise = promise.gain;
    round.better = true;
  }
}

Search::Round Search::fitPromises(std::size_t number) {
  Round round;
  round.number = number;
  round.best = now_;
  // A trifle beside what is left is not what is missing.
  round.least = std::max(options_.least_gain, options_.least_share * excess(now_));
  if (!stepped_back_) promises_ = screen(quick_, now_, tangents_, hypotheses_, round.least, &screened_);
  stepped_back_ = false;
  for (const Promise& p : promises_) {
    if (isRefused(p.hypothesis)) continue;
    if (bench_.cancelled()) break;
    if (!worthFitting(round, p, promises_.front().gain)) continue;
    if (isHint(round, p)) ++round.hints;
    fitPromise(p, round);
  }
  if (all_ && !round.better) fitStanding(round);
  return round;
}

// What takes little of all that is left may take all of it where it acts: the fit tests say so.
void Search::fitStanding(Round& round) {
  constexpr std::size_t MOST = 2;
  screenRough(quick_, now_, tangents_, options_.least_gain, &screened_, &promises_);
  std::size_t fitted = 0;
  for (const Promise& p : promises_) {
    if (fitted >= MOST || p.gain < options_.least_gain || bench_.cancelled()) return;
    const bool tried = std::any_of(round.rungs.begin(), round.rungs.end(),
                                   [&](const Rung& r) { return r.hypothesis == p.hypothesis; });
    if (tried || isRefused(p.hypothesis) || p.start.empty() ||
        !Standing::holdsInFitted(fittedShare(quick_, p)))
      continue;
    fitPromise(p, round);
    ++fitted;
  }
}

// It takes most of what is left, or the fit tests ask for it as they must where it is named: what does not
// hold beside what is left takes the shape of that.
bool Search::isBetter(const Fit& tried) const {
  constexpr double MUCH = 0.25;  // [1] of what is left
  if (!tried.converged) return false;
  const double gain = now_.bic - tried.bic;
  if (gain <= leastGain(quick_.runner(), now_, tried, options_)) return false;
  return gain > MUCH * excess(now_) || Standing::holdsInFitted(fittedShare(quick_, tried, now_));
}

// Takes a round's best fit in and fits everything anew beside it, until no more comes of it than an effect
// must take: what is left to take by the values that are there looks like another effect.
void Search::settle(Fit best) {
  constexpr int PASSES = 4;
  tangents_ = linearise(best.state);
  if (const auto one = withPiecesJoined(best.state, hypotheses_)) {
    Fit merged = quick_.fit(*one, &tangents_, CLOSELY);
    if (merged.bic < best.bic) {
      best = std::move(merged);
      tangents_ = linearise(best.state);
    }
  }
  const Fit refined = refit(best, CLOSELY);
  // The tangents held where the fit began; where it went far they are taken anew.
  constexpr double FAR = 0.01;  // [1] of the squares that it took
  tangents_ = best.bic - refined.bic > FAR * refined.bic
                  ? linearise(refined.state)
                  : bench_.lineariseBy(std::move(tangents_), near(refined.state));
  now_ = withPhasesTurned(refit(refined, CLOSELY));
  settleFromStated();
  for (int pass = 0; pass < PASSES; ++pass) {
    tangents_ = bench_.lineariseBy(std::move(tangents_), near(now_.state));
    if (bench_.cancelled()) break;
    const double before = now_.bic;
    now_ = refit(now_, CLOSELY);
    if (before - now_.bic < std::max(options_.least_gain, options_.least_share * excess(now_))) break;
  }
}

// Beside nominal values that were pulled far away while it was missing an effect may have taken a shape that
// goes with them, in a valley of its own: once more beside the stated ones, then with all free. The quick
// twin is left corrected wherever that was tried last.
void Search::settleFromStated() {
  constexpr double HOPELESS = 2.0;  // times the squares that are left now
  if (near(now_.state).nominal == now_.state.nominal) return;
  FitState stated = now_.state;
  stated.nominal.assign(stated.nominal.size(), 0.0);
  const Fit beside = quick_.fit(stated, nullptr, {8, 1e-4, false});
  if (!beside.converged || beside.chi2 > HOPELESS * now_.chi2) return;
  NominalTangents tangents = linearise(beside.state);
  Fit free = quick_.fit(beside.state, &tangents, CLOSELY);
  if (!free.converged || free.bic >= now_.bic) return;
  tangents_ = bench_.lineariseBy(std::move(tangents), near(free.state));
  now_ = withPhasesTurned(refit(free, CLOSELY));
}

// What was found earlier may have stood for what has been found now.
void Search::dropNeedless() {
  for (std::size_t m = 0; m < now_.state.members.size() && now_.state.members.size() > 1;) {
    Fit less = quick_.fit(without(now_.state, m), &tangents_, {6, 1e-3, true});
    if (!tells(quick_.runner(), less, now_, options_)) {
      options_.say("  not needed any more: " + now_.state.members[m].hypothesis->title());
      now_ = std::move(less);
    } else {
      ++m;
    }
  }
}

// What does not shrink the gap of tests that it was not fitted to takes the shape of something else.
bool Search::helpsElsewhere(const Fit& before, const Hypothesis& newest) {
  bench_.turnTo(now_.state);
  const AskedShare asked = standingOf(bench_, now_.state, before.state).heldout;
  if (!Standing::isDenied(asked)) return true;
  options_.say(
      formatted("held-out tests ask for %.2g +- %.2g of it, not taken: ", asked.share, asked.std_dev) +
      newest.title());
  return false;
}

void Search::stepBack(Begin begin) {
  ++repeated_;
  now_ = std::move(begin.fit);
  const bool turned = bench_.turnPhases(now_.state) > 0.0;
  tangents_ =
      turned ? linearise(now_.state) : bench_.lineariseBy(std::move(begin.tangents), near(now_.state));
  now_ = refit(now_, {8, 1e-4, true});
  exact_now_ = bench_.exactSquares(now_.state);
}

void Search::refuse(Begin begin, const Hypothesis* newest) {
  ++in_vain_;
  refused_.push_back(newest);
  stepBack(std::move(begin));
  stepped_back_ = true;
}

// @return false: nothing more is to be added
bool Search::addEffect(std::size_t number) {
  constexpr std::size_t MOST_IN_VAIN = 3;
  Round round = fitPromises(number);
  const bool better = round.better && !bench_.cancelled();
  const Hypothesis* const newest = better ? round.best.state.members.back().hypothesis : nullptr;
  const std::size_t first = result_.ladder.size();
  result_.ladder.insert(result_.ladder.end(), round.rungs.begin(), round.rungs.end());
  if (!better) return false;
  Begin before{now_, std::move(tangents_)};
  settle(std::move(round.best));
  dropNeedless();
  const double exact_squares = bench_.exactSquares(now_.state);
  if (!(exact_squares < exact_now_)) {
    options_.say(gapText(exact_squares) + " when simulated exactly, not taken: " + newest->title());
    // What was not needed beside the others is not for want of small steps.
    if (isMember(now_.state, newest->effect) && bench_.refineQuick()) {
      options_.say("  again with smaller steps");
      screened_.clear();
      stepBack(std::move(before));
    } else {
      refuse(std::move(before), newest);
    }
    return true;
  }
  if (!helpsElsewhere(before.fit, *newest)) {
    if (std::find(result_.refused.begin(), result_.refused.end(), newest) == result_.refused.end())
      result_.refused.push_back(newest);
    refuse(std::move(before), newest);
    return in_vain_ < MOST_IN_VAIN;
  }
  in_vain_ = 0;
  refused_.clear();  // they were so without it
  auto& denied = result_.refused;
  denied.erase(std::remove(denied.begin(), denied.end(), newest), denied.end());
  for (std::size_t k = first; k < result_.ladder.size(); ++k)
    result_.ladder[k].tried.taken = result_.ladder[k].hypothesis == newest;
  exact_now_ = exact_squares;
  options_.say(gapText(now_.chi2) + " with " + describe(now_.state.members.back()));
  return true;
}

void Search::finish() {
  bench_.guideNearLimit(now_.state);
  bench_.trustAt(now_.state);
  result_.best = now_;
  bool refined = refine(bench_, now_.state, options_, &result_);
  // With everything settled an effect may turn out to be needed no more.
  while (refined && !result_.contribution.empty()) {
    const auto least = std::min_element(result_.contribution.begin(), result_.contribution.end());
    const auto m = static_cast<std::size_t>(least - result_.contribution.begin());
    if (result_.needed[m]) break;
    options_.say("  not needed any more: " + result_.best.state.members[m].hypothesis->title());
    refined = refine(bench_, without(result_.best.state, m), options_, &result_);
  }
  if (refined) refined = takeBetterRivals();
  if (!refined) result_.forgetMembers();
  for (const Member& m : result_.best.state.members) options_.say("found " + describe(m));
}

// A round compares fits that have not settled; which of two that explain as much is better shows only now.
// @return false: the twin gives no numbers there
bool Search::takeBetterRivals() {
  constexpr int SWAPS = 3;
  for (int swap = 0; swap < SWAPS && !bench_.cancelled(); ++swap) {
    const auto ahead = [&](const Rival& r) { return r.delta_bic - result_.contribution[r.member]; };
    const auto best = std::max_element(result_.rivals.begin(), result_.rivals.end(),
                                       [&](const Rival& a, const Rival& b) { return ahead(a) < ahead(b); });
    if (best == result_.rivals.end() || ahead(*best) <= 0.0) return true;
    const Hypothesis& old = *result_.best.state.members[best->member].hypothesis;
    const Hypothesis& better = *best->state.members.back().hypothesis;
    options_.say("  better in the place of " + old.title() + ": " + better.title());
    result_.tellSwapped(old, better);
    const FitState state = best->state;
    if (!refine(bench_, state, options_, &result_)) return false;
  }
  return true;
}

// The free simulation judges, where it can follow the records at all.
void Search::letGo() {
  constexpr double FOLLOWS = 2.0;  // times the squares of the guided one
  followSimpler(quick_, now_, tangents_, &result_.ladder);
  const double guided = bench_.exactSquares(now_.state), free = bench_.freeSquares(now_.state);
  options_.say("guided by the tool's displacement " + gapText(guided) + ", simulated freely " +
               gapText(free));
  if (free < FOLLOWS * guided) bench_.guide(false);
}

// In units of what a fit of the nominal values takes, as seen on many campaigns.
void Search::tellCourse() const {
  constexpr double ROUND = 2.0, LAST_ROUND = 1.0, WHOLE = 2.0, AFTER = 4.0;
  const double done = 1.0 + ROUND * static_cast<double>(rounds_) + (all_ ? WHOLE : 0.0);
  const double left = AFTER + LAST_ROUND + (all_ ? 0.0 : WHOLE);
  options_.tell(done / (done + left));
}

void Search::rounds() {
  tellCourse();
  while (rounds_ < options_.most_effects + repeated_ && !bench_.cancelled()) {
    if (!addEffect(rounds_++)) break;
    tellCourse();
  }
}

// All of the records take up what the beginnings of them said.
void Search::beginFrom(const Search& brief) {
  options_.say("with whole records");
  bench_.guide(brief.bench_.guided());
  fitNominalHere(brief.result_.null.state.nominal);
  result_.ladder = brief.result_.ladder;
  result_.refused = brief.result_.refused;
  refused_ = brief.refused_;
  rounds_ = brief.rounds_;
  repeated_ = brief.repeated_ + 1;  // a round to see that nothing more is there
  if (brief.now_.state.members.empty()) {
    takePromises(brief);
    return;
  }
  const Fit null = now_;
  Fit begin = null;
  begin.state = brief.now_.state;
  settle(begin);
  const double exact_squares = bench_.exactSquares(now_.state);
  if (exact_squares < exact_now_) {
    exact_now_ = exact_squares;
    takePromises(brief);
    return;
  }
  now_ = null;
  tangents_ = linearise(now_.state);
}

// Where next to nothing is left, the most that hypotheses may promise on the longer records by the last
// screening of the brief ones, which found nothing: squares grow with the samples, or, of what grows in time
// itself, with their third power.
void Search::takePromises(const Search& brief) {
  constexpr double NEXT_TO_NOTHING = 0.02;  // [1] of the noise's squares
  constexpr double SHARE_OF_DUE = 0.25;     // that is worth a look
  const auto quiet = [&](const Search& s) { return s.excess(s.now_) < NEXT_TO_NOTHING * s.bench_.samples(); };
  if (!quiet(brief) || !quiet(*this)) return;
  const double longer = bench_.samples() / brief.bench_.samples();
  for (const Promise& p : brief.promises_)
    screened_.at_most[p.hypothesis] = p.gain * std::max(std::pow(longer, 3), longer / SHARE_OF_DUE);
}

void Search::look() {
  fitNominal();
  rounds();
}

SearchResult Search::run(const Search* brief) {
  all_ = true;
  if (brief) {
    beginFrom(*brief);
  } else {
    fitNominal();
  }
  rounds();
  if (bench_.guided()) letGo();
  finish();
  return std::move(result_);
}

}  // namespace

void SearchResult::tellSwapped(const Hypothesis& old, const Hypothesis& better) {
  for (Rung& r : ladder) {
    if (r.tried.effect == old.effect && r.tried.variant == old.variant) r.tried.taken = false;
    if (r.tried.effect == better.effect && r.tried.variant == better.variant) r.tried.taken = true;
  }
}

SearchResult search(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                    const SearchOptions& options) {
  const MachineModel& nominal = bench.data().nominal;
  const bool vibrates = !nominal.tool_tip.x.modes.empty() || !nominal.tool_tip.y.modes.empty();
  const std::optional<Dataset> part = vibrates ? briefOf(bench.data()) : std::nullopt;
  if (!part) return Search(bench, hypotheses, options).run(nullptr);
  Workbench brief_bench(*part, bench.options());
  Search brief(brief_bench, hypotheses, options);
  brief.look();
  return Search(bench, hypotheses, options).run(&brief);
}

}  // namespace smartmill::discrepancy
