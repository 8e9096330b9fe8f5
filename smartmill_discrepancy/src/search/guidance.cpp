#include "smartmill_discrepancy/search/guidance.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "smartmill_discrepancy/gap/scale_evidence.h"
#include "smartmill_sim/twin/tip_trajectory.h"

namespace smartmill::discrepancy {
namespace {

struct GuidanceOptions {
  /// Standard deviations of the squares of noise by which a free simulation near the stability limit must be
  /// worse than the guided one: noise alone reaches it in one of 30,000 cuts.
  double min_deviations = 4.0;
};

const GuidanceOptions LIMITS;

bool isGuidable(const TestData& test, const MachineModel& nominal) {
  return hasToolModes(nominal) && test.test.kind == TestKind::cut && !test.heldout &&
         !test.test.running_before && sim::TipTrajectory::isAvailable(test.record);
}

// A value displaced by u.r has the variance of lines of random phase, largest if u overlaps the lines of the
// residual: equivalent to more noise with fewer independent samples.
ChannelWeight weightOf(const std::vector<double>& residual) {
  double sum = 0.0, squares = 0.0, all = 0.0;
  for (const double r : residual) all += r * r;
  const std::vector<double> power = powerSpectrum(residual.data(), residual.size());
  for (const double p : power) {
    sum += p;
    squares += p * p;
  }
  const double mean_square = all / static_cast<double>(residual.size());
  if (!(sum > 0.0) || !std::isfinite(sum)) return {};
  // For white noise the mean of squares is twice the square of the mean.
  const double concentration = std::max(1.0, 0.5 * static_cast<double>(power.size()) * squares / (sum * sum));
  const double noise = std::sqrt(std::max(1.0, concentration * mean_square));
  return {noise, std::min(1.0, mean_square / (noise * noise))};
}

}  // namespace

Guidance::Guidance(Twins& twins, RecordAlignments& alignment, const Fitter& fitter)
    : twins_(twins),
      alignment_(alignment),
      fitter_(fitter),
      is_possible_(std::any_of(twins.data.tests.begin(), twins.data.tests.end(),
                               [&](const TestData& t) { return isGuidable(t, twins.data.nominal); })) {
}

void Guidance::set(bool active) {
  for (TestData& t : twins_.data.tests) t.guided = t.chatter.has_value();
  twins_.readGuidance();
  twins_.setGuided(active && is_possible_);
}

void Guidance::updateWeights(const FitState& state) {
  const TwinRunner& runner = twins_.exact;
  std::vector<TestData>& tests = twins_.data.tests;
  if (std::none_of(runner.tests().begin(), runner.tests().end(),
                   [&](std::size_t t) { return tests[t].guided; }))
    return;
  alignment_.alignFitted(state);
  const std::vector<double> simulated = runner.simulate(fitter_.model(state));
  for (const ChannelSpan& b : runner.spans()) {
    TestData& test = tests[b.test];
    if (!test.guided) continue;
    std::vector<double> residual(b.size);
    const double scale = b.noise / (b.slow ? b.slow->noise : twins_.data.noise.at(b.channel));
    for (std::size_t i = 0; i < b.size; ++i)
      residual[i] = scale * (simulated[b.offset + i] - runner.measured()[b.offset + i]);
    test.weights[b.channel] = weightOf(residual);
  }
  twins_.readGuidance();
}

void Guidance::guideNearLimit(const FitState& state) {
  if (!is_possible_ || isActive()) return;
  alignment_.alignFitted(state);
  const MachineModel model = fitter_.model(state);
  TwinRunner& heldout = twins_.heldout;
  bool any =
      markNearLimit(twins_.exact, twins_.exact.simulate(model), twins_.guided, twins_.guided.simulate(model));
  const std::vector<double> freely = heldout.simulate(model);
  TwinSettings settings = heldout.settings();
  settings.guided = true;
  heldout.set(settings);
  const std::vector<double> guided = heldout.simulate(model);
  settings.guided = false;
  heldout.set(settings);
  any = markNearLimit(heldout, freely, heldout, guided) || any;
  if (any) twins_.readGuidance();
}

double Guidance::freeSquares(const FitState& state) {
  alignment_.alignFitted(state);
  return residualSquares(twins_.exact, twins_.exact.simulate(fitter_.model(state)));
}

// @return whether a cut is guided from now on
bool Guidance::markNearLimit(const TwinRunner& free, const std::vector<double>& freely,
                             const TwinRunner& guided_runner, const std::vector<double>& guided) {
  std::map<std::size_t, double> gain, samples;
  for (const ChannelSpan& b : free.spans()) {
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i)
      gain[b.test] +=
          std::pow(freely[i] - free.measured()[i], 2) - std::pow(guided[i] - guided_runner.measured()[i], 2);
    samples[b.test] += static_cast<double>(b.size);
  }
  bool any = false;
  for (const auto& [t, gained] : gain) {
    TestData& test = twins_.data.tests[t];
    if (test.guided || !canBeGuided(test, twins_.data.nominal) ||
        !(gained > LIMITS.min_deviations * std::sqrt(2.0 * samples[t])))
      continue;
    test.guided = any = true;
  }
  return any;
}

}  // namespace smartmill::discrepancy
