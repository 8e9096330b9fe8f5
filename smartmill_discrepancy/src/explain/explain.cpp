#include "smartmill_discrepancy/explain/explain.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "explain/time_budget.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/data/labels.h"
#include "smartmill_discrepancy/explain/empirical_residual_model.h"
#include "smartmill_discrepancy/explain/outcome.h"
#include "smartmill_discrepancy/explain/recalibration.h"
#include "smartmill_discrepancy/explain/sentence.h"
#include "smartmill_discrepancy/explain/verdict.h"
#include "smartmill_discrepancy/explain/whitened_refit.h"
#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/validation.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

/// Shares of a time budget at which the stages end.
struct StageEnds {
  double search = 0.5;     ///< a fit of an effect may last until its next step ends
  double whitened = 0.75;  ///< refit and validation of the effects
  double empirical = 0.9;  ///< the rest: deviations, gaps
};

void throwIfAny(const Dataset& data, const std::vector<std::string>& reasons) {
  std::string all;
  for (const std::string& r : reasons) all += (all.empty() ? "" : "; ") + r;
  if (!reasons.empty()) throw Error(data.campaign.folder + ": " + all);
}

void requireFiniteResidual(const TwinRunner& runner, const std::vector<double>& residual) {
  for (const ChannelSpan& b : runner.spans()) {
    const std::vector<double> values = valuesOf(residual, b);
    if (!std::all_of(values.begin(), values.end(), [](double r) { return std::isfinite(r); }))
      throw Error(runner.data().campaign.folder + ": test " + runner.data().tests[b.test].test.name +
                  ": the twin gives no finite values of " + b.channel);
  }
}

Finding chatterFinding(const std::string& test, double frequency, double amplitude) {
  Finding f;
  f.channel = "fx";
  f.tests = {test};
  f.domain = "frequency";
  f.location["frequency_hz"] = frequency;
  f.depends_on = {"cutting"};
  f.amplitude = amplitude;
  f.p_value = 1e-300;
  return f;
}

// Reports chattering cuts: guided ones whose prediction error exceeds the chatter threshold, and others in
// which the model does not chatter.
void addChatter(const Dataset& data, Explanation* result) {
  sim::SimulationOptions options;
  options.noise = false;
  for (const ChatteringCut& c : result->chattering) {
    const Finding f = chatterFinding(c.test, c.frequency, c.amplitude);
    if (c.before > CHATTER_SHARE) result->where.push_back(f);
    if (c.after > CHATTER_SHARE) result->unexplained.push_back(f);
  }
  for (const ChatteringTest& c : data.chattering) {
    const auto chatters = [&](const MachineModel& model) {
      const Record simulated = sim::simulateTest(model, c.data.test, c.data.record, options);
      return findChatter(simulated, c.data.test, c.data.first_cut).has_value();
    };
    if (chatters(data.nominal)) continue;
    const Finding f = chatterFinding(c.data.test.name, c.chatter.frequency, c.chatter.amplitude);
    result->where.push_back(f);
    if (!chatters(result->model)) result->unexplained.push_back(f);
  }
}

// Catalogue effects that an empirical effect has replaced.
void reportReplaced(const FitState& named, const FitState& now, std::vector<Resemblance>* resembles) {
  for (const Member& m : named.members) {
    if (std::none_of(now.members.begin(), now.members.end(),
                     [&](const Member& other) { return other.hypothesis == m.hypothesis; }))
      resembles->push_back({m.hypothesis->effect, m.hypothesis->variant,
                            "closest effect of the catalogue, but an empirical effect explains more"});
  }
}

// Names that the end of the work left without validation are no names.
void withdrawNotValidated(const SearchResult& found, Explanation* result) {
  for (std::size_t m = result->effects.size(); m-- > 0;) {
    const Hypothesis& hypothesis = *found.best.state.members[m].hypothesis;
    const auto& open = found.not_validated;
    if (std::find(open.begin(), open.end(), &hypothesis) == open.end()) continue;
    result->resembles.push_back(
        {hypothesis.effect, hypothesis.variant,
         "in the improved model, but the search ended before it was validated next to an empirical effect"});
    result->effects.erase(result->effects.begin() + static_cast<std::ptrdiff_t>(m));
  }
}

// Withdraws all effects if the model with them is worse than the nominal one.
void withdrawEffects(const SearchResult& found, Explanation* result) {
  for (std::size_t m = 0; m < result->effects.size(); ++m) {
    const Hypothesis& hypothesis = *found.best.state.members[m].hypothesis;
    result->resembles.push_back(
        {hypothesis.effect, hypothesis.variant,
         "closest effect of the catalogue, but the model with it is worse than the nominal one"});
  }
  result->effects.clear();
  result->not_separable.clear();
  result->suggested_test.reset();
}

// Effects and deviations use the whitened fit; gaps use unweighted samples from here on.
MachineModel describeModel(Workbench& bench, const SearchOptions& options, const SearchResult& found,
                           Explanation* result) {
  for (const Candidate& r : found.candidates) result->candidates.push_back(r.result);
  MachineModel improved = nameEffects(bench, options, found, result);
  bench.clearWhitening();
  if (result->effects.empty()) return improved;
  const TwinRunner& heldout = bench.heldout();
  const auto residual = [&](const FitState& state) {
    return residualOf(heldout, bench.exact().model(state));
  };
  const std::vector<double> best = residual(found.best.state);
  for (std::size_t m = 0; m < result->effects.size(); ++m) {
    FoundEffect& effect = result->effects[m];
    const std::vector<double> without = residual(found.without_member[m]);
    effect.heldout_gap_reduction = reductionOf(best, without);
    effect.heldout_without = gapOf(heldout, without);
    auto rival = effect.alternatives.begin();
    for (const Alternative& alternative : found.alternatives) {
      if (alternative.member == m) (rival++)->heldout_gap = gapOf(heldout, residual(alternative.state));
    }
  }
  return improved;
}

// Names, each once, in the order of the catalogue.
std::vector<std::string> effectsOf(const std::vector<const Hypothesis*>& hypotheses) {
  std::vector<std::string> names;
  for (const Hypothesis* h : hypotheses) {
    if (std::find(names.begin(), names.end(), h->effect) == names.end()) names.push_back(h->effect);
  }
  return names;
}

// All of them as one group, and the test that separates one of them best.
void reportEquivalents(const std::vector<Equivalent>& equivalents, Explanation* result) {
  std::vector<std::string> group;
  const Equivalent* best = nullptr;
  for (const Equivalent& one : equivalents) {
    if (std::find(group.begin(), group.end(), one.effect) == group.end()) group.push_back(one.effect);
    if (one.test && (!best || one.test->difference > best->test->difference)) best = &one;
  }
  if (!group.empty()) result->not_separable.push_back(std::move(group));
  if (best && best->test->difference > MIN_SEPARATION) {
    result->suggested_test = best->test->text;
    result->suggested_cut = best->test->test;
    result->outcome = best->test->outcome;
    result->outcome->second = best->effect;
  }
}

void addTests(const Dataset& data, Explanation* result) {
  const auto add = [&](const TestData& t, bool left_out) {
    result->tests.push_back(
        {t.test, static_cast<double>(t.record.size()) / t.test.sample_rate, t.heldout, left_out});
  };
  for (const TestData& t : data.tests) add(t, false);
  for (const ChatteringTest& t : data.chattering) add(t.data, true);
}

void noteToothPath(const MachineModel& model, Explanation* result) {
  const EffectEntry* const path = toothPathOf(model);
  if (path == nullptr) return;
  const auto std_dev = path->std_devs.find("share");
  result->notes.push_back(formatted("surface: %.3f", path->numbers.at("share")) +
                          (std_dev == path->std_devs.end() ? "" : formatted(" +- %.2g", std_dev->second)) +
                          " of the way from the surface rule of formats.md to the true tooth path");
}

void logVerdict(const SearchOptions& options, const Explanation& e) {
  options.log(formatted("verdict %s; gap %.4f -> %.4f, held out %.4f -> %.4f", nameOf(e.verdict),
                        e.before.fit, e.after.fit, e.before.heldout, e.after.heldout));
}

}  // namespace

Explanation explain(const Dataset& data, const ExplainOptions& options, const std::string& folder) {
  const auto begin = std::chrono::steady_clock::now();
  Explanation result;
  result.notes = data.notes;
  result.stream_shifts = data.stream_shifts;
  result.nominal = data.nominal;
  result.noise = data.noise;
  addTests(data, &result);
  const Labels labels = checkLabels(data, options.bench.threads);
  throwIfAny(data, labels.wrong);

  const StageEnds ends;
  TimeBudget budget(options.elapsed, options.budget);
  const auto cancelled = [&] { return options.bench.cancelled && options.bench.cancelled(); };
  WorkbenchOptions bench_options = options.bench;
  bench_options.cancelled = [&] { return cancelled() || budget.isStageOver(); };
  Workbench bench(data, bench_options);
  const ModelResidual before = residualOf(bench, data.nominal);
  requireFiniteResidual(bench.fitted(), before.fit);
  requireFiniteResidual(bench.heldout(), before.heldout);
  result.before = before.gap;
  options.search.log(
      formatted("gap of the nominal model: %.4f, held out %.4f", result.before.fit, result.before.heldout));

  SearchOptions search_options = options.search;
  if (!labels.doubtful.empty())
    search_options.max_effects = std::min<std::size_t>(search_options.max_effects, 2);
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, &result.untestable);
  budget.beginStage(ends.search);
  SearchResult found = search(bench, hypotheses, search_options);
  result.not_tried = effectsOf(found.not_tried);
  std::vector<const Hypothesis*> testable;
  for (const Hypothesis& h : hypotheses) testable.push_back(&h);
  result.testable = effectsOf(testable).size();

  // The part of the residual that calibrated nominal values remove is not a disagreement.
  StructureOptions structure = options.structure;
  structure.squares_of_gap = std::max(found.null.chi2 - bench.samples(), 1.0);
  result.where = findStructure(bench.fitted(), found.null.residual, structure);
  options.search.reportProgress(0.65);
  budget.beginStage(ends.whitened);
  SearchResult whitened = validateWhitened(bench, hypotheses, search_options, &found, &result.resembles);
  options.search.reportProgress(0.75);
  result.unexplained = findStructure(bench.fitted(), found.best.residual, structure);
  budget.beginStage(ends.empirical);
  EmpiricalResidualModel empirical_model(bench, options, structure);
  const FitState named = found.best.state;
  const std::optional<FitState> named_only = empirical_model.extend(&found, &result.unexplained);
  options.search.reportProgress(0.9);
  reportReplaced(named, found.best.state, &result.resembles);
  result.interrupted = cancelled();
  budget.beginStage(1.0);
  found = finalResult(bench, std::move(whitened), found);
  const Eigen::MatrixXd of_fit = found.best.covariance;
  found.best.covariance = robustCovariance(bench, found.best);
  dropInsignificantPathShare(data.nominal, bench.freedom(), of_fit, &found.best);
  bench.guidance().set(false);
  bench.alignment().alignTo(found.best.state);

  MachineModel improved = describeModel(bench, search_options, found, &result);
  const GapPair after = residualOf(bench, improved).gap;
  if (after.fit <= before.gap.fit && after.heldout <= before.gap.heldout) {
    result.sentence = sentenceOf(result);
    result.calibrated = calibratedValues(bench.freedom(), found.best);
    if (named_only) result.named_only = residualOf(bench, bench.exact().model(*named_only)).gap;
    withdrawNotValidated(found, &result);
  } else {
    improved = data.nominal;
    withdrawEffects(found, &result);
    result.unexplained = findStructure(bench.fitted(), found.null.residual, structure);
  }
  noteToothPath(improved, &result);
  writeOutcome(bench, before, improved, folder, &result);
  addChatter(bench.data(), &result);
  result.verdict = verdictOf(result, search_options.negligible_excess);
  if (result.verdict == Verdict::no_disagreement) result.where.clear();
  if (result.verdict == Verdict::recalibrated) {
    result.recalibrated = recalibratedValues(bench.freedom(), found.best);
    const std::vector<Equivalent> equivalents =
        equivalentEffects(bench, hypotheses, search_options, found.best);
    result.sentence = sentenceOf(result.recalibrated, equivalents);
    reportEquivalents(equivalents, &result);
  }
  // A missing effect that acts in one test may look like a wrong label; the improved model decides.
  if (!labels.doubtful.empty() && !result.unexplained.empty())
    throwIfAny(data, doubtfulLabels(improved, bench.data(), options.bench.threads));
  if (budget.isSpent()) result.spent_budget = options.budget;
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  logVerdict(options.search, result);
  return result;
}

}  // namespace smartmill::discrepancy
