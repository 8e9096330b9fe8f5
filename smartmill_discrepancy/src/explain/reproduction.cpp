#include "smartmill_discrepancy/explain/reproduction.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/gap/repeatability.h"

namespace smartmill::discrepancy {
namespace {

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
                                          const std::vector<double>& after, std::size_t min_piece) {
  std::map<std::size_t, TestEvidence> tests;
  std::map<std::size_t, std::vector<double>> pieces;
  for (const ChannelSpan& b : runner.spans()) {
    if (!b.in_gap) continue;
    const CampaignTest& test = runner.data().tests[b.test].test;
    std::size_t revolution = min_piece;
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

// RMS of the asynchronous part of each span, at least the noise.
std::vector<double> floorsOf(const TwinRunner& runner) {
  std::vector<double> floors;
  for (const ChannelSpan& b : runner.spans()) {
    floors.push_back(1.0);
    const TestData& test = runner.data().tests[b.test];
    if (b.slow || test.test.kind != TestKind::cut) continue;
    const auto synchronous = steadyRepeatability(test, valuesOf(runner.measured(), b));
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

// Residuals of the fitted and the held-out tests. Records without measured angle are aligned with the state,
// since modes shift its phases.
std::pair<std::vector<double>, std::vector<double>> Reproduction::residualsOf(const FitState& state) const {
  if (bench_.alignment().phasesEstimated()) {
    FitState there = state;
    bench_.alignment().alignPhases(there);  // possibly by another tooth
    bench_.alignment().alignTo(there);
  }
  const MachineModel model = bench_.exact().model(state);
  return {residualOf(bench_.fitted(), model), residualOf(bench_.heldout(), model)};
}

bool Reproduction::isReproduced(const FitState& before, const FitResult& with) const {
  const auto [fit_before, held_before] = residualsOf(before);
  const auto [fit_after, held_after] = residualsOf(with.state);
  const std::vector<TestEvidence> fitted =
      evidenceBetween(bench_.fitted(), fit_before, fit_after, criteria_.min_piece);
  const std::vector<TestEvidence> heldout =
      evidenceBetween(bench_.heldout(), held_before, held_after, criteria_.min_piece);
  const TestEvidence fit = sumOf(fitted), held = sumOf(heldout);
  const double against =
      std::max(contradiction(fitted, criteria_.min_deviations) / std::max(fit.gain, 1.0),
               contradiction(heldout, criteria_.min_deviations) / std::max(held.gain, 1.0));
  const bool reproduced = fit.gain > options_.min_share * fit.excess &&
                          held.gain / held.excess > criteria_.min_reproduced * fit.gain / fit.excess &&
                          held.gain > criteria_.min_reproduced * held.change &&
                          criteria_.min_reproduced * held.gain < held.change &&
                          held.gain > criteria_.min_deviations * std::sqrt(held.variance) &&
                          against < criteria_.max_contradicted;
  options_.log(formatted(
      "  empirical: %s removes %.3f of the residual, held out %.3f (%.2f of its change there, %.1f standard "
      "deviations), contradicted by %.2f: %s",
      with.state.members.back().hypothesis->title().c_str(), fit.gain / std::max(fit.excess, 1.0),
      held.gain / std::max(held.excess, 1.0), held.gain / std::max(held.change, 1.0),
      held.gain / std::sqrt(std::max(held.variance, 1.0)), against,
      reproduced ? "reproduced" : "not reproduced"));
  return reproduced;
}

ValidationResult Reproduction::validateWeighted(const FitState& better, const FitState& other,
                                                const std::string& what) const {
  const auto [fit_other, held_other] = residualsOf(other);
  const auto [fit_better, held_better] = residualsOf(better);
  const ValidationResult validation{
      effectScaleOf(weightedEvidence(bench_.heldout(), held_better, held_other)),
      effectScaleOf(weightedEvidence(bench_.fitted(), fit_better, fit_other))};
  options_.log("  " + what + ": " + validation.text());
  return validation;
}

}  // namespace smartmill::discrepancy
