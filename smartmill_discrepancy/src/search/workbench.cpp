#include "smartmill_discrepancy/search/workbench.h"

#include <algorithm>

namespace smartmill::discrepancy {
namespace {

// By span, from the residual of a model.
std::vector<Whitening> whiteningOf(const TwinRunner& runner, const MachineModel& model) {
  const std::vector<double> residual = residualOf(runner, model);
  std::vector<Whitening> of_spans;
  for (const ChannelSpan& b : runner.spans()) of_spans.emplace_back(&residual[b.offset], b.size);
  return of_spans;
}

}  // namespace

Workbench::Workbench(const Dataset& data, const WorkbenchOptions& options)
    : options_(options),
      twins_(data, options),
      freedom_(data.nominal),
      quick_(twins_.quick, freedom_, options.cancelled),
      exact_(twins_.exact, freedom_, options.cancelled),
      alignment_(twins_, quick_),
      guidance_(twins_, alignment_, quick_) {
  FitState stated;
  stated.nominal.assign(freedom_.coordinates().size(), 0.0);
  guidance_.updateWeights(stated);
}

void Workbench::correctAt(const FitState& state, double* exact_squares) {
  const MachineModel model = quick_.model(state);
  alignment_.alignFitted(state);
  twins_.quick.readPhases();
  const std::vector<double> simulated = fitted().simulate(model);
  if (exact_squares) *exact_squares = residualSquares(fitted(), simulated);
  twins_.quick.correctTo(model, simulated);
}

NominalTangents Workbench::linearise(const FitState& state, double* exact_squares) {
  correctAt(state, exact_squares);
  const SimulatedChannels simulated_there = twins_.quick.simulateChannels({quick_.model(state)}).front();
  const bool hold =
      last_linearised_ && last_linearised_->state == state &&
      std::equal(simulated_there.begin(), simulated_there.end(), last_linearised_->simulated_there.begin(),
                 last_linearised_->simulated_there.end(),
                 [](const auto& a, const auto& b) { return a == b || *a == *b; });
  if (!hold) last_linearised_ = LinearisedState{state, simulated_there, quick_.nominalTangents(state)};
  return last_linearised_->tangents;
}

NominalTangents Workbench::lineariseBy(NominalTangents tangents, const FitState& state,
                                       double* exact_squares) {
  correctAt(state, exact_squares);
  tangents.at = state.nominal;
  tangents.alignment = state.alignment;
  tangents.alignment.resize(quick_.alignment().size(), 0.0);
  return tangents;
}

double Workbench::exactSquares(const FitState& state) {
  alignment_.alignFitted(state);
  return residualSquares(fitted(), fitted().simulate(quick_.model(state)));
}

bool Workbench::whitenAt(const FitState& state) {
  clearWhitening();
  if (twins_.isGuided()) return false;
  alignment_.alignTo(state);
  const MachineModel model = quick_.model(state);
  const std::vector<Whitening> of_fitted = whiteningOf(fitted(), model),
                               of_heldout = whiteningOf(heldout(), model);
  const auto changes = [](const Whitening& w) { return w.isActive(); };
  if (std::none_of(of_fitted.begin(), of_fitted.end(), changes)) return false;
  for (TwinRunner* runner : {&twins_.quick, &twins_.exact, &twins_.guided}) runner->setWhitening(of_fitted);
  twins_.heldout.setWhitening(of_heldout);
  return true;
}

void Workbench::clearWhitening() {
  for (TwinRunner* runner : twins_.all()) runner->setWhitening({});
}

}  // namespace smartmill::discrepancy
