#include "smartmill_discrepancy/explain/empirical_residual_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/explain/residual_localisation.h"
#include "smartmill_discrepancy/explain/revolution_table.h"
#include "smartmill_discrepancy/gap/repeatability.h"
#include "smartmill_discrepancy/search/evidence.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {
namespace {

constexpr FitOptions CLOSELY{8, 1e-4, true};

// Candidate forms, located in the residual.
std::vector<Hypothesis> formsFor(const TwinRunner& runner, const FitResult& now,
                                 const std::vector<Finding>& unexplained) {
  const std::vector<Hypothesis> all = empiricalHypotheses(runner.data());
  const std::vector<Hypothesis> placed = localisedForms(runner, all, now, unexplained);
  std::vector<Hypothesis> forms;
  std::copy_if(all.begin(), all.end(), std::back_inserter(forms),
               [](const Hypothesis& h) { return !h.probes.empty(); });
  forms.insert(forms.end(), placed.begin(), placed.end());
  return forms;
}

// Effect of a change of the model on one test, squares over noise.
struct TestEvidence {
  double gain = 0.0;      // reduction of the residual's squares
  double change = 0.0;    // squares of the change itself: the gain if the change is correct
  double excess = 0.0;    // squares above the noise without the change
  double variance = 0.0;  // of the gain, from its scatter over the revolutions
};

// Variance of the sum of the gains of equal pieces, one per revolution.
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

// @param before, after residuals of two models
std::vector<TestEvidence> evidenceBetween(const TwinRunner& runner, const std::vector<double>& before,
                                          const std::vector<double>& after) {
  constexpr std::size_t MIN_PIECE = 64;
  std::map<std::size_t, TestEvidence> tests;
  std::map<std::size_t, std::vector<double>> pieces;
  for (const ChannelSpan& b : runner.spans()) {
    if (!b.in_gap) continue;
    const CampaignTest& test = runner.data().tests[b.test].test;
    std::size_t revolution = MIN_PIECE;
    if (test.spindle_speed > 0.0)
      revolution = std::max(revolution,
                            static_cast<std::size_t>(units::TWO_PI / test.spindle_speed * test.sample_rate));
    TestEvidence& evidence = tests[b.test];
    std::vector<double>& of_test = pieces[b.test];
    of_test.resize(std::max(of_test.size(), b.size / revolution + 1), 0.0);
    for (std::size_t i = 0; i < b.size; ++i) {
      const std::size_t k = b.offset + i;
      const double r = before[k], s = after[k];
      of_test[i / revolution] += r * r - s * s;
      evidence.gain += r * r - s * s;
      evidence.change += (r - s) * (r - s);
      evidence.excess += r * r - 1.0;
    }
  }
  std::vector<TestEvidence> all;
  for (auto& [test, evidence] : tests) {
    evidence.variance = varianceOf(pieces[test]);
    all.push_back(evidence);
  }
  return all;
}

TestEvidence sumOf(const std::vector<TestEvidence>& tests) {
  TestEvidence sum;
  for (const TestEvidence& t : tests) {
    sum.gain += t.gain;
    sum.change += t.change;
    sum.excess += t.excess;
    sum.variance += t.variance;
  }
  return sum;
}

// Largest significant loss of a test.
double contradiction(const std::vector<TestEvidence>& tests, double deviations) {
  double worst = 0.0;
  for (const TestEvidence& t : tests) {
    if (-t.gain > deviations * std::sqrt(t.variance)) worst = std::max(worst, -t.gain);
  }
  return worst;
}

}  // namespace

// Residuals of the fitted and the held-out tests. Records without measured angle are aligned with the state,
// since modes shift its phases.
std::pair<std::vector<double>, std::vector<double>> EmpiricalResidualModel::residualsOf(
    const FitState& state) const {
  if (bench_.phasesEstimated()) {
    FitState there = state;
    bench_.alignPhases(there);  // possibly by another tooth
    bench_.alignTo(there);
  }
  const MachineModel model = bench_.exact().model(state);
  return {residualOf(bench_.fitted(), model), residualOf(bench_.heldout(), model)};
}

// A real cause reduces the residual of held-out tests by a similar share as that of the fitted ones.
bool EmpiricalResidualModel::isReproduced(const FitState& before, const FitResult& with) const {
  const auto [fit_before, held_before] = residualsOf(before);
  const auto [fit_after, held_after] = residualsOf(with.state);
  const std::vector<TestEvidence> fitted = evidenceBetween(bench_.fitted(), fit_before, fit_after);
  const std::vector<TestEvidence> heldout = evidenceBetween(bench_.heldout(), held_before, held_after);
  const TestEvidence fit = sumOf(fitted), held = sumOf(heldout);
  const double against =
      std::max(contradiction(fitted, criteria_.min_deviations) / std::max(fit.gain, 1.0),
               contradiction(heldout, criteria_.min_deviations) / std::max(held.gain, 1.0));
  const bool reproduced = fit.gain > criteria_.min_share * fit.excess &&
                          held.gain / held.excess > criteria_.min_reproduced * fit.gain / fit.excess &&
                          held.gain > criteria_.min_reproduced * held.change &&
                          criteria_.min_reproduced * held.gain < held.change &&
                          held.gain > criteria_.min_deviations * std::sqrt(held.variance) &&
                          against < criteria_.max_contradicted;
  options_.search.log(formatted(
      "  empirical: %s removes %.3f of the residual, held out %.3f (%.2f of its change there, %.1f standard "
      "deviations), contradicted by %.2f: %s",
      with.state.members.back().hypothesis->title().c_str(), fit.gain / std::max(fit.excess, 1.0),
      held.gain / std::max(held.excess, 1.0), held.gain / std::max(held.change, 1.0),
      held.gain / std::sqrt(std::max(held.variance, 1.0)), against,
      reproduced ? "reproduced" : "not reproduced"));
  return reproduced;
}

// Removes catalogue effects that the empirical one has made unnecessary.
FitResult EmpiricalResidualModel::withoutUnneeded(FitResult fit, const NominalTangents& tangents) const {
  for (std::size_t m = 0; m + 1 < fit.state.members.size();) {
    FitResult less = bench_.quick().fit(without(fit.state, m), &tangents, {6, 1e-3, true});
    if (isSignificant(bench_.quick().runner(), less, fit, options_.search)) {
      ++m;
      continue;
    }
    options_.search.log("  no longer needed: " + fit.state.members[m].hypothesis->title());
    fit = std::move(less);
  }
  return fit;
}

// Fits the forms with the largest predicted gain in addition to a fit.
// @param min_predicted, least predicted and BIC gain against that fit @param most fits
std::vector<FitResult> EmpiricalResidualModel::fitsInAddition(const FitResult& now,
                                                              const NominalTangents& tangents,
                                                              double min_predicted, double least,
                                                              std::size_t most, SearchResult* found,
                                                              ScreeningMemory* memory) const {
  const std::size_t round = found->candidates.empty() ? 0 : found->candidates.back().result.round + 1;
  const Fitter& quick = bench_.quick();
  std::vector<FitResult> fits;
  std::size_t fitted = 0;
  FitOptions options = CLOSELY;
  options.to_beat = now.chi2 + now.penalty - least;
  for (const PredictedGain& p : screen(quick, now, tangents, forms_.back(), min_predicted, memory)) {
    if (p.gain < min_predicted || ++fitted > most || bench_.cancelled()) break;
    FitState with = now.state;
    with.members.push_back({p.hypothesis, bestStart(quick, now, p)});
    FitResult fit;
    found->candidates.push_back(fitCandidate(
        quick, p, round, now, [&] { return quick.fit(with, &tangents, options); }, &fit));
    const double gain = now.bic - fit.bic;
    options_.search.log(formatted("  empirical, predicted gain %.4g, gain %.4g: %s", p.gain, gain,
                                  p.hypothesis->title().c_str()));
    if (fit.converged && gain > least) fits.push_back(std::move(fit));
  }
  return fits;
}

// One empirical effect may replace several catalogue effects.
std::vector<FitResult> EmpiricalResidualModel::fitsAsReplacement(SearchResult* found,
                                                                 ScreeningMemory* memory) const {
  const FitState nominal{found->null.state.nominal, {}, found->best.state.alignment};
  const NominalTangents here = bench_.linearise(nominal);
  const FitResult now = bench_.quick().fit(nominal, &here, CLOSELY);
  if (!now.converged) return {};
  // derivatives are inaccurate far from the start
  constexpr double MIN_PREDICTED = 0.1;
  const double least = now.bic - found->best.bic;
  return fitsInAddition(now, here, MIN_PREDICTED * least, least, criteria_.fits_as_replacement, found,
                        memory);
}

bool EmpiricalResidualModel::accept(const FitResult& start, const FitState& before,
                                    SearchResult* found) const {
  const NominalTangents here = bench_.linearise(start.state);
  FitResult fit = bench_.quick().fit(start.state, &here, CLOSELY);
  if (!fit.converged || !isReproduced(before, fit)) return false;
  fit = withoutUnneeded(std::move(fit), here);
  SearchResult more = *found;
  for (Candidate& r : more.candidates)
    r.result.accepted = r.result.accepted || r.hypothesis == fit.state.members.back().hypothesis;
  // The refined values must reproduce the gain, and the names must not explain more.
  if (!refine(bench_, fit.state, options_.search, &more) || !isReproduced(before, more.best)) return false;
  // Against the replaced names the same rule applies as for a name.
  if (more.best.bic > found->best.bic - options_.search.min_gain ||
      !validate(bench_, more.best.state, found->best.state).isAccepted())
    return false;
  *found = std::move(more);
  return true;
}

bool EmpiricalResidualModel::addOne(SearchResult* found, const std::vector<Finding>& unexplained) {
  forms_.push_back(formsFor(bench_.quick().runner(), found->best, unexplained));
  const FitState before = found->best.state;
  const NominalTangents tangents = bench_.linearise(before);
  const double least =
      std::max(options_.search.min_gain, criteria_.min_share * (found->best.chi2 - bench_.samples()));
  ScreeningMemory memory;
  const std::vector<FitResult> additions =
      fitsInAddition(found->best, tangents, 0.5 * least, least, criteria_.fits_in_addition, found, &memory);
  const bool named = std::any_of(before.members.begin(), before.members.end(), [](const Member& m) {
    return !findEffect(m.hypothesis->effect)->empirical();
  });
  // One empirical effect instead of several names is the simpler model, unless the names leave almost
  // nothing.
  constexpr double NEGLIGIBLE = 0.02;  // [1] of the squares of the noise
  const bool unexplained_rest = found->best.chi2 > (1.0 + NEGLIGIBLE) * bench_.samples();
  if (named && unexplained_rest && !replacement_tried_) {
    replacement_tried_ = true;
    const std::vector<FitResult> replacements = fitsAsReplacement(found, &memory);
    if (acceptFirst(replacements, {before.nominal, {}, before.alignment}, found)) return true;
  }
  return acceptFirst(additions, before, found) || addRevolutionTable(found, least);
}

// A residual without a simple form may still be synchronous with the spindle.
bool EmpiricalResidualModel::addRevolutionTable(SearchResult* found, double least) {
  if (hasRevolutionTable(found->best.state)) return false;
  const TwinRunner& runner = bench_.quick().runner();
  const std::vector<std::size_t> cuts = cutsOfVaryingFeed(runner);
  if (cuts.empty() || bench_.cancelled()) return false;
  bench_.alignTo(found->best.state);
  const auto law =
      identifyChipLaw(runner, cuts, bench_.data().nominal, bench_.quick().model(found->best.state));
  const FitState state = law ? realigned(found->best.state, law->phase_shift) : found->best.state;
  const NominalTangents tangents = bench_.linearise(state);
  const FitResult now = bench_.quick().fit(state, &tangents, {0, 1e-8, true});
  if (!now.converged) return false;
  const auto table = revolutionTable(runner, empiricalHypotheses(runner.data()), now);
  if (!table) return false;
  forms_.push_back({*table});
  ScreeningMemory memory;
  const std::vector<FitResult> fits = fitsInAddition(now, tangents, 0.5 * least, least, 1, found, &memory);
  if (!acceptFirst(fits, found->best.state, found)) return false;
  refineTable(state.alignment, found);
  for (std::size_t m = 0; m + 1 < found->best.state.members.size();) {
    if (!dropIfUnneeded(m, found)) ++m;
  }
  if (law) addFeedCurvature(cuts, found);
  return true;
}

// The fit used unweighted samples and moved values towards asynchronous parts; the table is estimated again
// with its own weights.
void EmpiricalResidualModel::refineTable(const std::vector<double>& alignment, SearchResult* found) {
  const TwinRunner& runner = bench_.quick().runner();
  FitState state = found->best.state;
  state.alignment = alignment;
  const NominalTangents before = bench_.linearise(state);
  FitResult here = bench_.quick().fit(state, &before, {0, 1e-8, true});
  if (!here.converged) return;
  const auto refined = revolutionTable(runner, empiricalHypotheses(runner.data()), here);
  if (!refined) return;
  forms_.push_back({*refined});
  state.members.back() = {&forms_.back().front(), {1.0}};
  const NominalTangents tangents = bench_.linearise(state);
  here = bench_.quick().fit(state, &tangents, {0, 1e-8, true});
  if (here.converged) replaceTable(std::move(here), found);
}

// Adds phase shifts to records without measured angle.
FitState EmpiricalResidualModel::realigned(FitState state, const std::vector<double>& by) const {
  const std::vector<Fitter::FreeAlignment>& alignment = bench_.quick().alignment();
  state.alignment.resize(alignment.size(), 0.0);
  for (std::size_t k = 0; k < alignment.size(); ++k) {
    if (alignment[k].freedom.value == &RecordAlignment::phase) state.alignment[k] += by[alignment[k].chosen];
  }
  return state;
}

// Replaces the revolution table, the last member.
void EmpiricalResidualModel::replaceTable(FitResult with, SearchResult* found) const {
  const Member& table = with.state.members.back();
  const Hypothesis* const old = found->best.state.members.back().hypothesis;
  for (std::size_t m = 0; m + 1 < with.state.members.size() && m < found->without_member.size(); ++m) {
    for (Member& other : found->without_member[m].members) {
      if (other.hypothesis == old) other = table;
    }
  }
  found->contribution.back() += found->best.bic - with.bic;
  found->best = std::move(with);
}

// Removes a catalogue effect unless the tests accept it in addition to a table fitted without it.
// @return false: it remains
bool EmpiricalResidualModel::dropIfUnneeded(std::size_t member, SearchResult* found) {
  const FitState now = found->best.state;
  const FitState bare = without(without(now, now.members.size() - 1), member);
  const std::optional<FitResult> less = bench_.cancelled() ? std::nullopt : withTable(bare, {});
  if (!less) return false;
  const ValidationResult validation = validateWeighted(now, less->state);
  const std::string title = now.members[member].hypothesis->title();
  logValidation(title + " with the table", validation);
  const bool stays = validation.isAccepted();
  if (!stays) removeMember(member, *less, found);
  bench_.alignTo(found->best.state);
  return !stays;
}

void EmpiricalResidualModel::removeMember(std::size_t member, const FitResult& less, SearchResult* found) {
  options_.search.log("  no longer needed: " + found->best.state.members[member].hypothesis->title());
  const auto at = static_cast<std::ptrdiff_t>(member);
  found->contribution.erase(found->contribution.begin() + at);
  found->is_needed.erase(found->is_needed.begin() + at);
  found->alternatives.clear();
  found->best = less;
  found->without_member.clear();
  const NominalTangents tangents = bench_.linearise(less.state);
  for (std::size_t m = 0; m < less.state.members.size(); ++m) {
    const FitResult rest = bench_.quick().fit(without(less.state, m), &tangents, {6, 1e-3, true});
    found->without_member.push_back(rest.state);
    found->contribution[m] = rest.bic - less.bic;
  }
}

void EmpiricalResidualModel::logValidation(const std::string& what,
                                           const ValidationResult& validation) const {
  options_.search.log(
      formatted("  %s: effect scale of the fitted tests %.3g +- %.2g, of the held-out tests %.3g +- %.2g",
                what.c_str(), validation.fitted.scale, validation.fitted.std_dev, validation.heldout.scale,
                validation.heldout.std_dev));
}

// Adds the curvature of the nonlinear chip law to the table if the tests accept it.
void EmpiricalResidualModel::addFeedCurvature(const std::vector<std::size_t>& cuts, SearchResult* found) {
  const FitState linear_table = found->best.state;
  const FitState bare = without(linear_table, linear_table.members.size() - 1);
  bench_.alignTo(linear_table);
  const auto law =
      identifyChipLaw(bench_.quick().runner(), cuts, bench_.data().nominal, bench_.quick().model(bare));
  if (!law) return;
  const auto describe = [](const ChipLaw& l) {
    return formatted("exponent %.2g, edge force %.2g of the model with onset %.3g um", l.exponent,
                     l.edge_share, l.onset / units::UM);
  };
  options_.search.log(formatted(
      "  nonlinear chip law: %s; axial force: %s; weighted squares of the lines %.4g (linear %.4g)",
      describe(law->in_plane).c_str(), describe(law->axial).c_str(), law->squares, law->linear_squares));
  const bool significant = law->linear_squares - law->squares >= law->requiredReduction();
  if (!law->isNonlinear() || !significant || bench_.cancelled()) return;
  std::optional<FitResult> with = withTable(bare, law->curvature);
  if (!with || !isReproduced(bare, *with)) return;
  const ValidationResult validation = validateWeighted(with->state, linear_table);
  logValidation("table with curvature", validation);
  // The law was chosen on the fitted tests, so only the held-out tests decide.
  if (validation.heldout.margin() > ValidationResult::HELDOUT_MARGIN) replaceTable(std::move(*with), found);
  bench_.alignTo(found->best.state);
}

// A state with a revolution table and curvature.
std::optional<FitResult> EmpiricalResidualModel::withTable(FitState state, const FeedCurvature& curvature) {
  const NominalTangents tangents = bench_.linearise(state);
  const FitResult bare = bench_.quick().fit(state, &tangents, {0, 1e-8, true});
  if (!bare.converged) return {};
  const TwinRunner& runner = bench_.quick().runner();
  const auto table = revolutionTable(runner, empiricalHypotheses(runner.data()), bare, curvature);
  if (!table) return {};
  forms_.push_back({*table});
  state.members.push_back({&forms_.back().front(), {1.0}});
  const NominalTangents here = bench_.linearise(state);
  FitResult with = bench_.quick().fit(state, &here, {0, 1e-8, true});
  if (!with.converged) return {};
  return with;
}

namespace {

// RMS of the asynchronous part of each span, at least the noise.
std::vector<double> floorsOf(const TwinRunner& runner) {
  std::vector<double> floors;
  for (const ChannelSpan& b : runner.spans()) {
    floors.push_back(1.0);
    const TestData& test = runner.data().tests[b.test];
    if (b.slow || test.test.kind != TestKind::cut) continue;
    const auto from = runner.measured().begin() + static_cast<std::ptrdiff_t>(b.offset);
    const auto synchronous = steadyRepeatability(test, {from, from + static_cast<std::ptrdiff_t>(b.size)});
    if (synchronous) floors.back() = std::max(1.0, synchronous->floor);
  }
  return floors;
}

std::vector<ScaleEvidence> weightedEvidence(const TwinRunner& runner, const std::vector<double>& better,
                                            const std::vector<double>& other) {
  const std::vector<double> floors = floorsOf(runner);
  std::map<std::size_t, ScaleEvidence> tests;
  for (std::size_t k = 0; k < runner.spans().size(); ++k) {
    const ChannelSpan& b = runner.spans()[k];
    std::vector<double> change(b.size), residual(b.size);
    for (std::size_t i = 0; i < b.size; ++i) {
      residual[i] = better[b.offset + i] / floors[k];
      change[i] = other[b.offset + i] / floors[k] - residual[i];
    }
    tests[b.test].add(change.data(), residual.data(), b.size);
  }
  std::vector<ScaleEvidence> all;
  for (const auto& [test, evidence] : tests) all.push_back(evidence);
  return all;
}

}  // namespace

// The validation of search/validation.h with each record weighted by its asynchronous part and aligned with
// each model.
ValidationResult EmpiricalResidualModel::validateWeighted(const FitState& better,
                                                          const FitState& other) const {
  const auto [fit_other, held_other] = residualsOf(other);
  const auto [fit_better, held_better] = residualsOf(better);
  return {effectScaleOf(weightedEvidence(bench_.heldout(), held_better, held_other)),
          effectScaleOf(weightedEvidence(bench_.fitted(), fit_better, fit_other))};
}

bool EmpiricalResidualModel::acceptFirst(std::vector<FitResult> fits, const FitState& before,
                                         SearchResult* found) const {
  std::sort(fits.begin(), fits.end(), [](const FitResult& a, const FitResult& b) { return a.bic < b.bic; });
  for (std::size_t k = 0; k < std::min(fits.size(), criteria_.examined_fits) && !bench_.cancelled(); ++k) {
    if (accept(fits[k], before, found)) return true;
  }
  return false;
}

FitResult EmpiricalResidualModel::fitTwice(const FitState& state) const {
  const NominalTangents first = bench_.linearise(state);
  const FitResult once = bench_.quick().fit(state, &first, CLOSELY);
  if (!once.converged) return once;
  const NominalTangents there = bench_.linearise(once.state);
  return bench_.quick().fit(once.state, &there, CLOSELY);
}

std::optional<FitState> EmpiricalResidualModel::extend(SearchResult* found,
                                                       std::vector<Finding>* unexplained) {
  FitState named = found->best.state;
  std::vector<Finding> findings = *unexplained;
  std::size_t added = 0;
  for (; added < criteria_.max_effects && !findings.empty() && !bench_.cancelled(); ++added) {
    if (!addOne(found, findings)) break;
    findings = findStructure(bench_.fitted(), found->best.residual, structure_);
  }
  if (added == 0) return {};
  // Empirical effects count as unexplained; so does the part of removed catalogue effects.
  FitState named_part = found->best.state;
  named_part.members.erase(
      std::remove_if(named_part.members.begin(), named_part.members.end(),
                     [](const Member& m) { return findEffect(m.hypothesis->effect)->empirical(); }),
      named_part.members.end());
  if (named_part.members.size() == named.members.size()) return named;
  const FitResult rest = fitTwice(named_part);
  if (!rest.converged) return named;
  *unexplained = findStructure(bench_.fitted(), rest.residual, structure_);
  return rest.state;
}

}  // namespace smartmill::discrepancy
