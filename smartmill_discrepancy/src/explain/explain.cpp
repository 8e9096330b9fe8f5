#include "smartmill_discrepancy/explain/explain.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/data/labels.h"
#include "smartmill_discrepancy/explain/judge.h"
#include "smartmill_discrepancy/explain/nameless.h"
#include "smartmill_discrepancy/explain/outcome.h"
#include "smartmill_discrepancy/explain/sentence.h"
#include "smartmill_discrepancy/explain/weighed.h"
#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "smartmill_discrepancy/search/standing.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

void refuse(const Dataset& data, const std::vector<std::string>& reasons) {
  std::string all;
  for (const std::string& r : reasons) all += (all.empty() ? "" : "; ") + r;
  if (!reasons.empty()) throw Error(data.campaign.folder + ": " + all);
}

// A search needs numbers to begin with.
void refuseWithoutNumbers(const TwinRunner& runner, const std::vector<double>& residual) {
  for (const Block& b : runner.blocks()) {
    const auto from = residual.begin() + static_cast<std::ptrdiff_t>(b.offset);
    if (!std::all_of(from, from + static_cast<std::ptrdiff_t>(b.size),
                     [](double r) { return std::isfinite(r); }))
      throw Error(runner.data().campaign.folder + ": test " + runner.data().tests[b.test].test.name +
                  ": the twin gives no numbers for " + b.channel);
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

// A cut that chatters is followed by a model whose prediction leaves less of it than chatter is told by. One
// that nothing guides speaks for a model that chatters in it.
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

// Names that a cause without a name has made needless.
void tellFallen(const FitState& named, const FitState& now, std::vector<Resemblance>* resembles) {
  for (const Member& m : named.members) {
    if (std::none_of(now.members.begin(), now.members.end(),
                     [&](const Member& other) { return other.hypothesis == m.hypothesis; }))
      resembles->push_back({m.hypothesis->effect, m.hypothesis->variant,
                            "nearest shape in the catalogue, but one without a name explains more"});
  }
}

// What makes the model worse than the nominal one explains nothing.
void withdraw(const SearchResult& found, Explanation* result) {
  for (std::size_t m = 0; m < result->effects.size(); ++m) {
    const Hypothesis& hypothesis = *found.best.state.members[m].hypothesis;
    result->resembles.push_back(
        {hypothesis.effect, hypothesis.variant,
         "nearest shape in the catalogue, but the model with it is worse than the nominal one"});
  }
  result->effects.clear();
  result->not_separable.clear();
  result->suggested_test.reset();
}

// Names by weight; the gap is told of all samples alike, which stays.
MachineModel namedBy(Workbench& bench, const SearchOptions& options, const SearchResult& found,
                     Explanation* result) {
  for (const Rung& r : found.ladder) result->ladder.push_back(r.tried);
  MachineModel improved = nameEffects(bench, options, found, result);
  bench.weighAlike();
  for (std::size_t m = 0; m < result->effects.size(); ++m)
    result->effects[m].heldout_gap_reduction = heldoutReduction(bench, found.best.state, found.lacking[m]);
  return improved;
}

void tellSurface(const MachineModel& model, Explanation* result) {
  const EffectEntry* const path = toothPathOf(model);
  if (path == nullptr) return;
  const auto std_dev = path->std_devs.find("share");
  result->notes.push_back(
      formatted("surface: %.3f", path->numbers.at("share")) +
      (std_dev == path->std_devs.end() ? "" : formatted(" +- %.2g", std_dev->second)) +
      " of the way from the rule of formats.md to what the teeth of a machine leave on their path");
}

void sayVerdict(const SearchOptions& options, const Explanation& e) {
  options.say(formatted("verdict %s; gap %.4f -> %.4f, held out %.4f -> %.4f", nameOf(e.verdict),
                        e.before.fit, e.after.fit, e.before.heldout, e.after.heldout));
}

}  // namespace

Explanation explain(const Dataset& data, const ExplainOptions& options, const std::string& folder) {
  const auto begin = std::chrono::steady_clock::now();
  Explanation result;
  result.notes = data.notes;
  const Labels labels = checkLabels(data, options.bench.threads);
  refuse(data, labels.wrong);

  Workbench bench(data, options.bench);
  const Remains before = remainsOf(bench, data.nominal);
  refuseWithoutNumbers(bench.fitted(), before.fit);
  refuseWithoutNumbers(bench.heldout(), before.heldout);
  result.before = before.gap;
  options.search.say(
      formatted("gap of the nominal model: %.4f, held out %.4f", result.before.fit, result.before.heldout));

  SearchOptions searched = options.search;
  if (!labels.doubtful.empty()) searched.most_effects = std::min<std::size_t>(searched.most_effects, 2);
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, &result.notes);
  SearchResult found = search(bench, hypotheses, searched);

  // What the calibration of the nominal values takes away is no disagreement of their kind.
  StructureOptions structure = options.structure;
  structure.squares_of_gap = std::max(found.null.chi2 - bench.samples(), 1.0);
  result.where = findStructure(bench.fitted(), found.null.residual, structure);
  options.search.tell(0.65);
  SearchResult weighed = challengeWeighed(bench, hypotheses, searched, &found, &result.resembles);
  options.search.tell(0.75);
  result.unexplained = findStructure(bench.fitted(), found.best.residual, structure);
  Nameless nameless(bench, options, structure);
  const FitState named = found.best.state;
  const std::optional<FitState> named_only = nameless.extend(&found, &result.unexplained);
  options.search.tell(0.9);
  tellFallen(named, found.best.state, &result.resembles);
  result.interrupted = bench.cancelled();
  found = settledByWeight(bench, std::move(weighed), found);
  const Eigen::MatrixXd of_fit = found.best.covariance;
  found.best.covariance = settledCovariance(bench, found.best);
  leaveOutUntoldPath(data.nominal, bench.freedom(), of_fit, &found.best);
  bench.guide(false);
  bench.turnTo(found.best.state);

  MachineModel improved = namedBy(bench, searched, found, &result);
  const GapPair after = remainsOf(bench, improved).gap;
  if (after.fit <= before.gap.fit && after.heldout <= before.gap.heldout) {
    result.sentence = sentenceOf(result);
    if (named_only) result.named_only = remainsOf(bench, bench.exact().model(*named_only)).gap;
  } else {
    improved = data.nominal;
    withdraw(found, &result);
    result.unexplained = findStructure(bench.fitted(), found.null.residual, structure);
  }
  tellSurface(improved, &result);
  writeOutcome(bench, before, improved, folder, &result);
  addChatter(bench.data(), &result);
  result.verdict = verdictOf(result);
  if (result.verdict == Verdict::no_disagreement) result.where.clear();
  // What acts in one test most may look like another test's label; a model that has it clears it.
  if (!labels.doubtful.empty() && !result.unexplained.empty())
    refuse(data, doubtfulWith(improved, bench.data(), options.bench.threads));
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  sayVerdict(options.search, result);
  return result;
}

}  // namespace smartmill::discrepancy
