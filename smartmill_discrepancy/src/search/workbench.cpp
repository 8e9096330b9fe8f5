#include "smartmill_discrepancy/search/workbench.h"

#include <algorithm>

#include "smartmill_discrepancy/data/phase.h"

namespace smartmill::discrepancy {
namespace {

std::vector<std::size_t> testsOf(const Dataset& data, bool heldout) {
  std::vector<std::size_t> tests;
  for (std::size_t t = 0; t < data.tests.size(); ++t) {
    if (data.tests[t].heldout == heldout) tests.push_back(t);
  }
  return tests;
}

}  // namespace

Workbench::Workbench(const Dataset& data, const WorkbenchOptions& options)
    : data_(data),
      freedom_(data.nominal),
      phases_estimated_(std::any_of(data.tests.begin(), data.tests.end(),
                                    [](const TestData& t) { return t.phase_estimated; })),
      cancelled_(options.cancelled),
      quick_runner_(data_, testsOf(data_, false), options.threads, options.screening_substeps),
      exact_runner_(data_, testsOf(data_, false), options.threads, options.final_substeps),
      heldout_runner_(data_, testsOf(data_, true), options.threads, options.final_substeps),
      quick_(quick_runner_, freedom_, options.cancelled),
      exact_(exact_runner_, freedom_, options.cancelled) {
}

NominalTangents Workbench::linearise(const FitState& state, double* exact_squares) {
  const MachineModel model = quick_.model(state);
  const std::vector<double> simulated = exact_runner_.simulate(model);
  if (exact_squares) *exact_squares = squaresLeft(exact_runner_, simulated);
  quick_runner_.correctTo(model, simulated);
  return quick_.nominalTangents(state);
}

double Workbench::exactSquares(const FitState& state) const {
  return squaresLeft(exact_runner_, exact_runner_.simulate(quick_.model(state)));
}

bool Workbench::refineQuick() {
  constexpr int FINER = 4;
  if (quick_runner_.substeps() >= exact_runner_.substeps()) return false;
  quick_runner_.setSubsteps(std::min(FINER * quick_runner_.substeps(), exact_runner_.substeps()));
  return true;
}

double Workbench::turnPhases(const FitState& state) {
  if (!phases_estimated_) return 0.0;
  const double turn = discrepancy::turnPhases(data_, quick_.model(state));
  for (TwinRunner* runner : {&quick_runner_, &exact_runner_, &heldout_runner_}) runner->readPhases();
  return turn;
}

}  // namespace smartmill::discrepancy
