#include "smartmill_discrepancy/explain/nameless.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/explain/places.h"
#include "smartmill_discrepancy/explain/revolution.h"
#include "smartmill_discrepancy/gap/repeatability.h"
#include "smartmill_discrepancy/search/evidence.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/standing.h"

namespace smartmill::discrepancy {
namespace {

constexpr FitOptions CLOSELY{8, 1e-4, true};

// What may act without a name, at the places where the residual shows something.
std::vector<Hypothesis> formsFor(const TwinRunner& runner, const Fit& now,
                                 const std::vector<Finding>& unexplained) {
  const std::vector<Hypothesis> all = empiricalHypotheses(runner.data());
  const std::vector<Hypothesis> placed = placedForms(runner, all, now, unexplained);
  std::vector<Hypothesis> forms;
  std::copy_if(all.begin(), all.end(), std::back_inserter(forms),
               [](const Hypothesis& h) { return !h.probes.empty(); });
  forms.insert(forms.end(), placed.begin(), placed.end());
  return forms;
}

// What one test says of a change of the model, in squares over noise.
struct Said {
  double gain = 0.0;      // by which the residual's squares fall
  double change = 0.0;    // squares of the change itself: the gain, were it all true
  double left = 0.0;      // the residual's squares above the noise without the change
  double variance = 0.0;  // of the gain, by its scatter from revolution to revolution
};

// Gains of equal pieces, as long as a turn of the spindle. Mean times count has this variance.
double varianceOf(const std::vector<double>& pieces) {
  if (pieces.size() < 2) return 0.0;
  double sum = 0.0, squares = 0.0;
  for (const double p : pieces) {
    sum += p;
    squares += p * p;
  }
  const auto n = static_cast<double>(pieces.size());
  return std::max(squares - sum * sum / n, 0.0) * n / (n - 1.0);
}

// @param before, after what two models leave
std::vector<Said> saidBy(const TwinRunner& runner, const std::vector<double>& before,
                         const std::vector<double>& after) {
  constexpr std::size_t LEAST_PIECE = 64;
  std::map<std::size_t, Said> tests;
  std::map<std::size_t, std::vector<double>> pieces;
  for (const Block& b : runner.blocks()) {
    if (!b.judged) continue;
    const CampaignTest& test = runner.data().tests[b.test].test;
    std::size_t turn = LEAST_PIECE;
    if (test.spindle_speed > 0.0)
      turn = std::max(turn, static_cast<std::size_t>(units::TWO_PI / test.spindle_speed * test.sample_rate));
    Said& said = tests[b.test];
    std::vector<double>& of_test = pieces[b.test];
    of_test.resize(std::max(of_test.size(), b.size / turn + 1), 0.0);
    for (std::size_t i = 0; i < b.size; ++i) {
      const std::size_t k = b.offset + i;
      const double r = before[k], s = after[k];
      of_test[i / turn] += r * r - s * s;
      said.gain += r * r - s * s;
      said.change += (r - s) * (r - s);
      said.left += r * r - 1.0;
    }
  }
  std::vector<Said> all;
  for (auto& [test, said] : tests) {
    said.variance = varianceOf(pieces[test]);
    all.push_back(said);
  }
  return all;
}

Said sumOf(const std::vector<Said>& tests) {
  Said sum;
  for (const Said& t : tests) {
    sum.gain += t.gain;
    sum.change += t.change;
    sum.left += t.left;
    sum.variance += t.variance;
  }
  return sum;
}

// The largest gain that a test loses beyond chance.
double contradiction(const std::vector<Said>& tests, double deviations) {
  double worst = 0.0;
  for (const Said& t : tests) {
    if (-t.gain > deviations * std::sqrt(t.variance)) worst = std::max(worst, -t.gain);
  }
  return worst;
}

}  // namespace

// What a state leaves of the fit tests and of those held out, records whose angle nobody measured laid where
// it fits them: a mode turns its phases.
std::pair<std::vector<double>, std::vector<double>> Nameless::leftOf(const FitState& state) const {
  if (bench_.phasesEstimated()) {
    FitState there = state;
    bench_.turnPhases(there);  // perhaps by another tooth
    bench_.turnTo(there);
  }
  const MachineModel model = bench_.exact().model(state);
  const auto left = [&](const TwinRunner& runner) {
    std::vector<double> values = runner.simulate(model);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = runner.measured()[i] - values[i];
    return values;
  };
  return {left(bench_.fitted()), left(bench_.heldout())};
}

// A cause that is real shows the same in every test: it takes from tests that it never saw what it takes from
// those it was fitted to.
bool Nameless::repeats(const FitState& before, const Fit& with) const {
  const auto [fit_before, held_before] = leftOf(before);
  const auto [fit_after, held_after] = leftOf(with.state);
  const std::vector<Said> fitted = saidBy(bench_.fitted(), fit_before, fit_after);
  const std::vector<Said> heldout = saidBy(bench_.heldout(), held_before, held_after);
  const Said fit = sumOf(fitted), held = sumOf(heldout);
  const double against = std::max(contradiction(fitted, rule_.least_deviations) / std::max(fit.gain, 1.0),
                                  contradiction(heldout, rule_.least_deviations) / std::max(held.gain, 1.0));
  const bool holds =
      fit.gain > rule_.least_share * fit.left &&
      held.gain / held.left > rule_.least_repeated * fit.gain / fit.left &&
      held.gain > rule_.least_repeated * held.change && rule_.least_repeated * held.gain < held.change &&
      held.gain > rule_.least_deviations * std::sqrt(held.variance) && against < rule_.most_contradicted;
  options_.search.say(formatted(
      "  without a name: %s takes %.3f of what is left, held out %.3f (%.2f of what it changes there, %.1f "
      "deviations), contradicted %.2f: %s",
      with.state.members.back().hypothesis->title().c_str(), fit.gain / std::max(fit.left, 1.0),
      held.gain / std::max(held.left, 1.0), held.gain / std::max(held.change, 1.0),
      held.gain / std::sqrt(std::max(held.variance, 1.0)), against, holds ? "repeats" : "does not repeat"));
  return holds;
}

// An effect with a name may have stood for the one without.
Fit Nameless::withoutNeedless(Fit fit, const NominalTangents& tangents) const {
  for (std::size_t m = 0; m + 1 < fit.state.members.size();) {
    Fit less = bench_.quick().fit(without(fit.state, m), &tangents, {6, 1e-3, true});
    if (tells(bench_.quick().runner(), less, fit, options_.search)) {
      ++m;
      continue;
    }
    options_.search.say("  not needed any more: " + fit.state.members[m].hypothesis->title());
    fit = std::move(less);
  }
  return fit;
}

// Fits the forms that promise most beside what a fit holds already.
// @param promised, least gain of the tangents and of BIC against that fit @param most fits
std::vector<Fit> Nameless::fitsBeside(const Fit& now, const NominalTangents& tangents, double promised,
                                      double least, std::size_t most, SearchResult* found,
                                      ScreeningMemory* memory) const {
  const std::size_t round = found->ladder.empty() ? 0 : found->ladder.back().tried.round + 1;
  const Fitter& quick = bench_.quick();
  std::vector<Fit> fits;
  std::size_t fitted = 0;
  FitOptions options = CLOSELY;
  options.to_beat = now.chi2 + now.penalty - least;
  for (const Promise& p : screen(quick, now, tangents, forms_.back(), promised, memory)) {
    if (p.gain < promised || ++fitted > most || bench_.cancelled()) break;
    FitState with = now.state;
    with.members.push_back({p.hypothesis, bestStart(quick, now, p)});
    const auto begin = std::chrono::steady_clock::now();
    const std::size_t simulations = quick.runner().simulations();
    Fit fit = quick.fit(with, &tangents, options);
    const double gain = now.bic - fit.bic;
    options_.search.say(formatted("  without a name, promise %.4g, gain %.4g: %s", p.gain, gain,
                                  p.hypothesis->title().c_str()));
    found->ladder.push_back({{round, p.hypothesis->effect, p.hypothesis->variant, p.gain, gain, false,
                              std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(),
                              quick.runner().simulations() - simulations},
                             p.hypothesis,
                             fit.state.members.back().values});
    if (fit.converged && gain > least) fits.push_back(std::move(fit));
  }
  return fits;
}

// One cause without a name may do all that several names stand for.
std::vector<Fit> Nameless::fitsInstead(SearchResult* found, ScreeningMemory* memory) const {
  const FitState nominal{found->null.state.nominal, {}, found->best.state.turns};
  const NominalTangents here = bench_.linearise(nominal);
  const Fit now = bench_.quick().fit(nominal, &here, CLOSELY);
  if (!now.converged) return {};
  // Tangents say little of what is far away.
  constexpr double PROMISED = 0.1;
  const double least = now.bic - found->best.bic;
  return fitsBeside(now, here, PROMISED * least, least, rule_.fitted_instead, found, memory);
}

bool Nameless::take(const Fit& start, const FitState& before, SearchResult* found) const {
  const NominalTangents here = bench_.linearise(start.state);
  Fit fit = bench_.quick().fit(start.state, &here, CLOSELY);
  if (!fit.converged || !repeats(before, fit)) return false;
  fit = withoutNeedless(std::move(fit), here);
  SearchResult more = *found;
  for (Rung& r : more.ladder)
    r.tried.taken = r.tried.taken || r.hypothesis == fit.state.members.back().hypothesis;
  // Values settle; what repeated must still do, and nothing be lost that names had explained.
  if (!refine(bench_, fit.state, options_.search, &more) || !repeats(before, more.best)) return false;
  // Against the names that it takes the place of it must stand as a name would.
  if (more.best.bic > found->best.bic - options_.search.least_gain ||
      !standingOf(bench_, more.best.state, found->best.state).holds())
    return false;
  *found = std::move(more);
  return true;
}

bool Nameless::addOne(SearchResult* found, const std::vector<Finding>& unexplained) {
  forms_.push_back(formsFor(bench_.quick().runner(), found->best, unexplained));
  const FitState before = found->best.state;
  const NominalTangents tangents = bench_.linearise(before);
  const double least =
      std::max(options_.search.least_gain, rule_.least_share * (found->best.chi2 - bench_.samples()));
  ScreeningMemory memory;
  const std::vector<Fit> beside =
      fitsBeside(found->best, tangents, 0.5 * least, least, rule_.fitted, found, &memory);
  const bool named = std::any_of(before.members.begin(), before.members.end(), [](const Member& m) {
    return !findEffect(m.hypothesis->effect)->empirical();
  });
  // One cause in the place of several names is the simpler answer, where they leave something.
  constexpr double NEXT_TO_NOTHING = 0.02;  // [1] of the noise's squares
  const bool left = found->best.chi2 > (1.0 + NEXT_TO_NOTHING) * bench_.samples();
  if (named && left && !tried_instead_) {
    tried_instead_ = true;
    const std::vector<Fit> instead = fitsInstead(found, &memory);
    if (takeOne(instead, {before.nominal, {}, before.turns}, found)) return true;
  }
  return takeOne(beside, before, found) || addRevolution(found, least);
}

// What no form of few values explains may still come again with each revolution.
bool Nameless::addRevolution(SearchResult* found, double least) {
  if (hasRevolution(found->best.state)) return false;
  const TwinRunner& runner = bench_.quick().runner();
  const std::vector<std::size_t> cuts = cutsOfOneKind(runner);
  if (cuts.empty() || bench_.cancelled()) return false;
  bench_.turnTo(found->best.state);
  const auto law = bentLaw(runner, cuts, bench_.data().nominal, bench_.quick().model(found->best.state));
  const FitState state = law ? turned(found->best.state, law->turned) : found->best.state;
  const NominalTangents tangents = bench_.linearise(state);
  const Fit now = bench_.quick().fit(state, &tangents, {0, 1e-8, true});
  if (!now.converged) return false;
  const auto left = revolutionLeft(runner, empiricalHypotheses(runner.data()), now);
  if (!left) return false;
  forms_.push_back({*left});
  ScreeningMemory memory;
  const std::vector<Fit> fits = fitsBeside(now, tangents, 0.5 * least, least, 1, found, &memory);
  if (!takeOne(fits, found->best.state, found)) return false;
  settleRevolution(state.turns, found);
  for (std::size_t m = 0; m + 1 < found->best.state.members.size();) {
    if (!leaveOut(m, found)) ++m;
  }
  if (law) bendRevolution(cuts, found);
  return true;
}

// In the fit every sample counted alike, and values moved to what comes again in no other test; the table
// takes back what it can say of that with the weights of its own.
void Nameless::settleRevolution(const std::vector<double>& turns, SearchResult* found) {
  const TwinRunner& runner = bench_.quick().runner();
  FitState state = found->best.state;
  state.turns = turns;
  const NominalTangents before = bench_.linearise(state);
  Fit here = bench_.quick().fit(state, &before, {0, 1e-8, true});
  if (!here.converged) return;
  const auto settled = revolutionLeft(runner, empiricalHypotheses(runner.data()), here);
  if (!settled) return;
  forms_.push_back({*settled});
  state.members.back() = {&forms_.back().front(), {1.0}};
  const NominalTangents tangents = bench_.linearise(state);
  here = bench_.quick().fit(state, &tangents, {0, 1e-8, true});
  if (here.converged) putTable(std::move(here), found);
}

// Records without angle lie further.
FitState Nameless::turned(FitState state, const std::vector<double>& by) const {
  const std::vector<Fitter::TurnOf>& turns = bench_.quick().turns();
  state.turns.resize(turns.size(), 0.0);
  for (std::size_t k = 0; k < turns.size(); ++k) {
    if (turns[k].freedom.value == &Turn::middle) state.turns[k] += by[turns[k].chosen];
  }
  return state;
}

// In the place of the table that is the last member.
void Nameless::putTable(Fit with, SearchResult* found) const {
  const Member& table = with.state.members.back();
  const Hypothesis* const old = found->best.state.members.back().hypothesis;
  for (std::size_t m = 0; m + 1 < with.state.members.size() && m < found->lacking.size(); ++m) {
    for (Member& other : found->lacking[m].members) {
      if (other.hypothesis == old) other = table;
    }
  }
  found->contribution.back() += found->best.bic - with.bic;
  found->best = std::move(with);
}

// A name beside a table stays where the tests ask for it against a table that stands for it too.
// @return false: it stays
bool Nameless::leaveOut(std::size_t member, SearchResult* found) {
  const FitState now = found->best.state;
  const FitState bare = without(without(now, now.members.size() - 1), member);
  const std::optional<Fit> less = bench_.cancelled() ? std::nullopt : withBend(bare, {});
  if (!less) return false;
  const Standing standing = weightedStanding(now, less->state);
  const std::string title = now.members[member].hypothesis->title();
  say(title + " beside the table", standing);
  const bool stays = standing.holds();
  if (!stays) takeLess(member, *less, found);
  bench_.turnTo(found->best.state);
  return !stays;
}

void Nameless::takeLess(std::size_t member, const Fit& less, SearchResult* found) {
  options_.search.say("  not needed any more: " + found->best.state.members[member].hypothesis->title());
  const auto at = static_cast<std::ptrdiff_t>(member);
  found->contribution.erase(found->contribution.begin() + at);
  found->needed.erase(found->needed.begin() + at);
  found->rivals.clear();
  found->best = less;
  found->lacking.clear();
  const NominalTangents tangents = bench_.linearise(less.state);
  for (std::size_t m = 0; m < less.state.members.size(); ++m) {
    const Fit rest = bench_.quick().fit(without(less.state, m), &tangents, {6, 1e-3, true});
    found->lacking.push_back(rest.state);
    found->contribution[m] = rest.bic - less.bic;
  }
}

void Nameless::say(const std::string& what, const Standing& standing) const {
  options_.search.say(formatted("  %s: tests ask for %.3g +- %.2g of it, held-out ones for %.3g +- %.2g",
                                what.c_str(), standing.fitted.share, standing.fitted.std_dev,
                                standing.heldout.share, standing.heldout.std_dev));
}

// Law and sensor together bend the table over the feed, where the tests do ask for it.
void Nameless::bendRevolution(const std::vector<std::size_t>& cuts, SearchResult* found) {
  const FitState straight = found->best.state;
  const FitState bare = without(straight, straight.members.size() - 1);
  bench_.turnTo(straight);
  const auto law = bentLaw(bench_.quick().runner(), cuts, bench_.data().nominal, bench_.quick().model(bare));
  if (!law) return;
  const auto told = [](const ChipLaw& l) {
    return formatted("exponent %.2g, edge force of %.2g of the model's that comes on over %.3g um",
                     l.exponent, l.edge_share, l.onset / units::UM);
  };
  options_.search.say(formatted(
      "  a law that bends: %s; of axial forces %s; weighted squares of the lines %.4g (straight %.4g)",
      told(law->in_plane).c_str(), told(law->axial).c_str(), law->squares, law->straight_squares));
  const bool asked = law->straight_squares - law->squares >= law->costOfALaw();
  if (!law->bends() || !asked || bench_.cancelled()) return;
  std::optional<Fit> with = withBend(bare, law->bend);
  if (!with || !repeats(bare, *with)) return;
  const Standing standing = weightedStanding(with->state, straight);
  say("bent against straight", standing);
  // The fit tests have chosen the law; beside a table that takes up what either leaves of them they say no
  // more.
  if (standing.heldout.beyond() > Standing::HELDOUT_BEYOND) putTable(std::move(*with), found);
  bench_.turnTo(found->best.state);
}

// A table with a bend, beside a state.
std::optional<Fit> Nameless::withBend(FitState state, const Bend& bend) {
  const NominalTangents tangents = bench_.linearise(state);
  const Fit bare = bench_.quick().fit(state, &tangents, {0, 1e-8, true});
  if (!bare.converged) return {};
  const TwinRunner& runner = bench_.quick().runner();
  const auto bent = revolutionLeft(runner, empiricalHypotheses(runner.data()), bare, bend);
  if (!bent) return {};
  forms_.push_back({*bent});
  state.members.push_back({&forms_.back().front(), {1.0}});
  const NominalTangents here = bench_.linearise(state);
  Fit with = bench_.quick().fit(state, &here, {0, 1e-8, true});
  if (!with.converged) return {};
  return with;
}

namespace {

// What each block leaves, over what of its record does not come again with the revolution.
std::vector<double> floorsOf(const TwinRunner& runner) {
  std::vector<double> floors;
  for (const Block& b : runner.blocks()) {
    floors.push_back(1.0);
    const TestData& test = runner.data().tests[b.test];
    if (b.slow || test.test.kind != TestKind::cut || !test.record.has("spindle_angle")) continue;
    const auto from = static_cast<std::ptrdiff_t>(test.first_cut + (b.size - test.first_cut) / 8);
    const auto at = runner.measured().begin() + static_cast<std::ptrdiff_t>(b.offset);
    const std::vector<double>& angle = test.record.column("spindle_angle");
    const auto told = repeatability({at + from, at + static_cast<std::ptrdiff_t>(b.size)},
                                    {angle.begin() + from, angle.end()});
    if (told) floors.back() = std::max(1.0, told->floor);
  }
  return floors;
}

std::vector<AskedTest> weightedAsked(const TwinRunner& runner, const std::vector<double>& better,
                                     const std::vector<double>& other) {
  const std::vector<double> floors = floorsOf(runner);
  std::map<std::size_t, AskedTest> tests;
  for (std::size_t k = 0; k < runner.blocks().size(); ++k) {
    const Block& b = runner.blocks()[k];
    std::vector<double> between(b.size), left(b.size);
    for (std::size_t i = 0; i < b.size; ++i) {
      left[i] = better[b.offset + i] / floors[k];
      between[i] = other[b.offset + i] / floors[k] - left[i];
    }
    tests[b.test].add(between.data(), left.data(), b.size);
  }
  std::vector<AskedTest> all;
  for (const auto& [test, asked] : tests) all.push_back(asked);
  return all;
}

}  // namespace

// The rule of names (search/standing.h), each record over what of it does not come again and laid where each
// model fits it.
Standing Nameless::weightedStanding(const FitState& better, const FitState& other) const {
  const auto [fit_other, held_other] = leftOf(other);
  const auto [fit_better, held_better] = leftOf(better);
  return {sharedBy(weightedAsked(bench_.heldout(), held_better, held_other)),
          sharedBy(weightedAsked(bench_.fitted(), fit_better, fit_other))};
}

bool Nameless::takeOne(std::vector<Fit> fits, const FitState& before, SearchResult* found) const {
  std::sort(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) { return a.bic < b.bic; });
  for (std::size_t k = 0; k < std::min(fits.size(), rule_.examined) && !bench_.cancelled(); ++k) {
    if (take(fits[k], before, found)) return true;
  }
  return false;
}

Fit Nameless::fitted(const FitState& state) const {
  const NominalTangents first = bench_.linearise(state);
  const Fit once = bench_.quick().fit(state, &first, CLOSELY);
  if (!once.converged) return once;
  const NominalTangents there = bench_.linearise(once.state);
  return bench_.quick().fit(once.state, &there, CLOSELY);
}

std::optional<FitState> Nameless::extend(SearchResult* found, std::vector<Finding>* unexplained) {
  FitState named = found->best.state;
  std::vector<Finding> left = *unexplained;
  std::size_t added = 0;
  for (; added < rule_.most && !left.empty() && !bench_.cancelled(); ++added) {
    if (!addOne(found, left)) break;
    left = findStructure(bench_.fitted(), found->best.residual, structure_);
  }
  if (added == 0) return {};
  // What is not known by name stays unexplained. Names that fell away explain nothing any more.
  FitState kept = found->best.state;
  kept.members.erase(
      std::remove_if(kept.members.begin(), kept.members.end(),
                     [](const Member& m) { return findEffect(m.hypothesis->effect)->empirical(); }),
      kept.members.end());
  if (kept.members.size() == named.members.size()) return named;
  const Fit rest = fitted(kept);
  if (!rest.converged) return named;
  *unexplained = findStructure(bench_.fitted(), rest.residual, structure_);
  return rest.state;
}

}  // namespace smartmill::discrepancy
