#include "smartmill_discrepancy/search/validation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_core/math/normal.h"

namespace smartmill::discrepancy {
namespace {

struct ValidationOptions {
  /// Squares over the noise by which held-out tests distinguish two models: five standard deviations.
  double min_squares = 25.0;
};

const ValidationOptions LIMITS;

std::vector<ScaleEvidence> scaleEvidenceBetween(const TwinRunner& runner, const std::vector<double>& better,
                                                const std::vector<double>& other) {
  std::vector<double> change(runner.size()), residual(runner.size());
  for (std::size_t i = 0; i < change.size(); ++i) {
    change[i] = better[i] - other[i];
    residual[i] = runner.measured()[i] - better[i];
  }
  return scaleEvidenceIn(runner, change.data(), residual.data());
}

// Simulation of a state with its own alignment while the bench has that of another state: its values were
// fitted with it.
std::vector<double> simulatedAtOwnAlignment(const Workbench& bench, const FitState& state,
                                            const FitState& current) {
  const TwinRunner& runner = bench.fitted();
  const MachineModel model = bench.exact().model(state);
  SimulatedChannels simulated = runner.simulateChannels({model}).front();
  const std::vector<Fitter::FreeAlignment>& alignments = bench.quick().alignment();
  const auto at = [](const FitState& s, std::size_t k) { return s.alignment.empty() ? 0.0 : s.alignment[k]; };
  std::map<std::size_t, RecordAlignment> by_test;
  for (std::size_t k = 0; k < alignments.size(); ++k) {
    const double by = at(state, k) - at(current, k);
    if (by != 0.0) by_test[alignments[k].chosen].*alignments[k].freedom.value = by;
  }
  const std::vector<std::pair<std::size_t, RecordAlignment>> moved(by_test.begin(), by_test.end());
  const SimulatedChannels base = simulated;
  runParallel(moved.size(), runner.threads(), [&](std::size_t m) {
    const auto& [chosen, by] = moved[m];
    const SimulatedChannels realigned = runner.realigned(model, base, chosen, by);
    for (std::size_t b = 0; b < realigned.size(); ++b) {
      if (runner.spans()[b].test == runner.tests()[chosen]) simulated[b] = realigned[b];
    }
  });
  return runner.joined(simulated);
}

// Evidence of the priors; an unexplained residual displaces stated values too, so its variance is that of the
// residual.
ScaleEvidence priorEvidence(const NominalFreedom& freedom, const FitState& better, const FitState& other,
                            double variance) {
  ScaleEvidence evidence;
  const std::vector<Coordinate>& free = freedom.coordinates();
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double d = (better.nominal[c] - other.nominal[c]) / free[c].prior_std;
    evidence.squares += d * d;
    evidence.product += d * (free[c].null - better.nominal[c]) / free[c].prior_std;
  }
  evidence.variance = variance * evidence.squares;
  return evidence;
}

}  // namespace

EffectScale effectScaleOf(const std::vector<ScaleEvidence>& tests) {
  double squares = 0.0, product = 0.0;
  for (const ScaleEvidence& t : tests) {
    squares += t.squares;
    product += t.product;
  }
  if (squares <= 0.0) return {0.5, std::numeric_limits<double>::infinity()};
  return {1.0 + product / squares, std::sqrt(varianceOfProducts(tests)) / squares};
}

std::vector<ScaleEvidence> scaleEvidenceIn(const TwinRunner& runner, const double* change,
                                           const double* residual) {
  std::map<std::size_t, ScaleEvidence> by_test;
  for (const ChannelSpan& b : runner.spans())
    by_test[b.test].add(change + b.offset, residual + b.offset, b.size);
  std::vector<ScaleEvidence> all;
  for (const auto& [test, evidence] : by_test) all.push_back(evidence);
  return all;
}

EffectScale fittedScale(const Fitter& fitter, const FitResult& better, const FitResult& other) {
  std::vector<double> change(better.residual.size());
  for (std::size_t i = 0; i < change.size(); ++i) change[i] = other.residual[i] - better.residual[i];
  std::vector<ScaleEvidence> tests = scaleEvidenceIn(fitter.runner(), change.data(), better.residual.data());
  const double variance = std::max(1.0, better.chi2 / static_cast<double>(fitter.runner().size()));
  tests.push_back(priorEvidence(fitter.freedom(), better.state, other.state, variance));
  return effectScaleOf(tests);
}

const EffectScale& ValidationResult::weakerGroup() const {
  if (!std::isfinite(heldout.std_dev)) return fitted;
  return heldout.margin() / HELDOUT_MARGIN < fitted.margin() / FITTED_MARGIN ? heldout : fitted;
}

double ValidationResult::confidence() const {
  const double beyond =
      std::isfinite(heldout.std_dev) ? std::min(heldout.margin(), fitted.margin()) : fitted.margin();
  return normalCdf(beyond);
}

bool ValidationResult::isAccepted() const {
  const bool known = std::isfinite(heldout.std_dev);
  return isAcceptedByFitted(fitted) && (!known || heldout.margin() > HELDOUT_MARGIN);
}

std::string ValidationResult::text() const {
  return formatted("effect scale of the fitted tests %.3g +- %.2g, of the held-out tests %.3g +- %.2g",
                   fitted.scale, fitted.std_dev, heldout.scale, heldout.std_dev);
}

ValidationResult validate(const Workbench& bench, const FitState& better, const FitState& other) {
  const auto held = simulateAll(bench.heldout(), {bench.exact().model(better), bench.exact().model(other)});
  const std::vector<ScaleEvidence> heldout = scaleEvidenceBetween(bench.heldout(), held[0], held[1]);
  const std::vector<double> simulated = bench.fitted().simulate(bench.exact().model(better));
  std::vector<ScaleEvidence> fitted =
      scaleEvidenceBetween(bench.fitted(), simulated, simulatedAtOwnAlignment(bench, other, better));
  const double variance = std::max(1.0, residualSquares(bench.fitted(), simulated) / bench.samples());
  fitted.push_back(priorEvidence(bench.freedom(), better, other, variance));
  const double squares = std::accumulate(heldout.begin(), heldout.end(), 0.0,
                                         [](double sum, const ScaleEvidence& t) { return sum + t.squares; });
  return {effectScaleOf(squares < LIMITS.min_squares ? std::vector<ScaleEvidence>{} : heldout),
          effectScaleOf(fitted)};
}

double reductionOf(const std::vector<double>& better, const std::vector<double>& other) {
  const auto excess = [](const std::vector<double>& residual) {
    double squares = 0.0;
    for (const double r : residual) squares += r * r;
    return squares - static_cast<double>(residual.size());
  };
  const double with = excess(better), without_it = excess(other);
  return without_it > 0.0 ? std::clamp(1.0 - std::max(with, 0.0) / without_it, -1.0, 1.0) : 0.0;
}

}  // namespace smartmill::discrepancy
