#include "smartmill_discrepancy/search/screening.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "search/probes/probe_family.h"
#include "search/projection.h"

namespace smartmill::discrepancy {
namespace {

using Eigen::Index;

// Change of the records by the points of a probe.
SparseColumns columnsOf(const Fitter& fitter, const FitState& state, const Hypothesis& h,
                        const Hypothesis::Probe& probe, const SimulatedChannels& base) {
  std::vector<MachineModel> models;
  for (const std::vector<double>& point : probe.points) {
    FitState with = state;
    with.members.push_back({&h, point});
    models.push_back(fitter.model(with));
  }
  return {fitter.runner(), base, fitter.runner().simulateChannels(models),
          std::vector<double>(models.size(), 1.0)};
}

// Start of a fit from amplitudes along a probe's points.
std::vector<double> startOf(const Hypothesis& h, const Hypothesis::Probe& probe,
                            const Eigen::VectorXd& amplitudes) {
  std::vector<double> start = probe.from_points ? probe.points.front() : probe.null;
  for (Index k = 0; k < amplitudes.size() && !probe.from_points; ++k) {
    for (std::size_t c = 0; c < start.size(); ++c)
      start[c] += amplitudes[k] * (probe.points[static_cast<std::size_t>(k)][c] - probe.null[c]);
  }
  for (std::size_t c = 0; c < start.size(); ++c)
    start[c] = std::clamp(start[c], h.coordinates[c].low, h.coordinates[c].high);
  return start;
}

// Largest gain by remembered derivatives; no value without any.
std::optional<double> rememberedGain(const Projection& projection, const Hypothesis& h,
                                     const ScreeningMemory& memory) {
  const auto found = memory.columns.find(&h);
  if (found == memory.columns.end()) return {};
  double gain = 0.0;
  for (const Eigen::MatrixXf& columns : found->second)
    gain = std::max(gain, projection.roughGain(columns.cast<double>()));
  return gain;
}

// @param columns receives the thinned derivatives of the probes
PredictedGain predictGain(const Fitter& fitter, const FitResult& now, const Projection& projection,
                          const Hypothesis& h, const std::vector<Hypothesis::Probe>& probes,
                          std::vector<Eigen::MatrixXf>* columns) {
  PredictedGain best;
  best.hypothesis = &h;
  for (const Hypothesis::Probe& probe : probes) {
    const SparseColumns change = columnsOf(fitter, now.state, h, probe, projection.base());
    if (!change.allFinite() || change.squares().sum() == 0.0) continue;
    if (columns) columns->push_back(projection.thinned().of(change).cast<float>());
    const Projection::Reduction reduction = projection.reduction(change);
    if (reduction.gain <= best.gain) continue;
    std::vector<double> start = startOf(h, probe, reduction.amplitudes);
    if (start == probe.null) continue;  // the optimum is outside the bounds
    best.gain = reduction.gain;
    best.start = std::move(start);
    best.prior_evidence = projection.priorEvidence(reduction);
    if (best.gain > ValidationResult::requiredSquares()) {
      best.change = projection.changeBy(change, reduction);
      best.baseline_residual = projection.baselineResidual();
    }
    best.null = probe.from_points ? std::vector<double>{} : probe.null;
  }
  return best;
}

void sortByGain(std::vector<PredictedGain>* predictions) {
  std::stable_sort(predictions->begin(), predictions->end(),
                   [](const PredictedGain& a, const PredictedGain& b) { return a.gain > b.gain; });
}

}  // namespace

std::vector<PredictedGain> screen(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents,
                                  const std::vector<Hypothesis>& hypotheses, double required_gain,
                                  ScreeningMemory* memory) {
  // [1] of the required gain: a smaller remembered gain is not simulated again. Between two states of a
  // search gains rarely grow tenfold.
  constexpr double MIN_REMEMBERED = 0.1;
  const Projection projection(fitter, now, tangents);
  const MachineModel model = fitter.model(now.state);
  ProbeFinder finder(projection, fitter.runner(), model, now);
  struct Screened {
    const Hypothesis* hypothesis;
    std::vector<Hypothesis::Probe> probes;
    std::optional<std::vector<Eigen::MatrixXf>> columns;
    std::optional<PredictedGain> predicted;
  };
  const auto isBelowLimit = [&](const Hypothesis& h) {
    const auto most = memory->gain_limits.find(&h);
    return most != memory->gain_limits.end() && most->second < required_gain;
  };
  std::vector<Screened> screened;
  for (const Hypothesis& h : hypotheses) {
    if (fitter.cancelled()) break;
    if (hasMember(now.state, h.effect, h.variant) ||
        (!h.after.empty() && !hasMember(now.state, h.effect, h.after)))
      continue;
    screened.push_back({&h, {}, std::nullopt, std::nullopt});
    if (h.strategy != Hypothesis::SearchStrategy::none && !isBelowLimit(h))
      screened.back().probes = finder.probesOf(h);
  }
  runParallel(screened.size(), fitter.runner().threads(), [&](std::size_t k) {
    if (fitter.cancelled()) return;
    Screened& one = screened[k];
    const Hypothesis& h = *one.hypothesis;
    const bool below_limit = isBelowLimit(h);
    const std::optional<double> gain =
        below_limit ? memory->gain_limits.at(&h) : rememberedGain(projection, h, *memory);
    if (below_limit || (gain && *gain < MIN_REMEMBERED * required_gain)) {
      one.predicted.emplace();
      one.predicted->hypothesis = &h;
      one.predicted->approximate = true;
      one.predicted->gain = *gain;
      return;
    }
    // Probes with a searched location change with the state.
    const bool remembered = h.strategy == Hypothesis::SearchStrategy::none;
    if (remembered) one.columns.emplace();
    one.predicted = predictGain(fitter, now, projection, h, remembered ? h.probes : one.probes,
                                remembered ? &*one.columns : nullptr);
  });
  memory->gain_limits.clear();
  std::vector<PredictedGain> predictions;
  for (Screened& one : screened) {
    if (one.columns) memory->columns[one.hypothesis] = std::move(*one.columns);
    if (one.predicted) predictions.push_back(std::move(*one.predicted));
  }
  sortByGain(&predictions);
  return predictions;
}

void screenRemembered(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents,
                      double least, ScreeningMemory* memory, std::vector<PredictedGain>* predictions) {
  const Projection projection(fitter, now, tangents);
  const MachineModel model = fitter.model(now.state);
  ProbeFinder finder(projection, fitter.runner(), model, now);
  for (PredictedGain& p : *predictions) {
    if (!p.approximate || p.gain <= least || fitter.cancelled()) continue;
    const Hypothesis& h = *p.hypothesis;
    std::vector<Eigen::MatrixXf> columns;
    p = predictGain(fitter, now, projection, h, finder.probesOf(h), &columns);
    if (h.strategy == Hypothesis::SearchStrategy::none) memory->columns[&h] = std::move(columns);
  }
  sortByGain(predictions);
}

EffectScale fittedScale(const Fitter& fitter, const PredictedGain& predicted) {
  if (!predicted.change) return effectScaleOf({});
  const Eigen::VectorXd residual = *predicted.baseline_residual - *predicted.change;
  std::vector<ScaleEvidence> tests =
      scaleEvidenceIn(fitter.runner(), predicted.change->data(), residual.data());
  tests.push_back(predicted.prior_evidence);
  const double variance = std::max(1.0, residual.squaredNorm() / static_cast<double>(residual.size()));
  tests.back().variance = variance * predicted.prior_evidence.squares;
  return effectScaleOf(tests);
}

}  // namespace smartmill::discrepancy
