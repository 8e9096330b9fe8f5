#include "smartmill_discrepancy/explain/outcome.h"

#include <cmath>

namespace smartmill::discrepancy {
namespace {

std::vector<double> residualOf(const TwinRunner& runner, const MachineModel& model) {
  std::vector<double> r = runner.simulate(model);
  for (std::size_t i = 0; i < r.size(); ++i) r[i] = runner.measured()[i] - r[i];
  return r;
}

double rmsOf(const std::vector<double>& v, std::size_t from, std::size_t size) {
  double squares = 0.0;
  for (std::size_t i = from; i < from + size; ++i) squares += v[i] * v[i];
  return size ? std::sqrt(squares / static_cast<double>(size)) : 0.0;
}

// Chi-square statistic of noise alone varies by sqrt(2 / n).
double floorDeviation(std::size_t samples) {
  return samples ? std::sqrt(0.5 / static_cast<double>(samples)) : 0.0;
}

void addGaps(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
             bool heldout, std::vector<BlockGap>* gaps) {
  for (const Block& b : runner.blocks()) {
    gaps->push_back({runner.data().tests[b.test].test.name, b.channel, heldout,
                     rmsOf(before, b.offset, b.size), rmsOf(after, b.offset, b.size),
                     floorDeviation(b.size)});
  }
}

}  // namespace

Remains remainsOf(const Workbench& bench, const MachineModel& model) {
  Remains r{residualOf(bench.fitted(), model), residualOf(bench.heldout(), model), {}};
  r.gap = {rmsOf(r.fit, 0, r.fit.size()), rmsOf(r.heldout, 0, r.heldout.size())};
  return r;
}

void writeOutcome(const Workbench& bench, const Remains& before, const MachineModel& improved,
                  const std::string& folder, Explanation* result) {
  const std::string file = folder + "/model.yaml";
  writeMachineModel(improved, file);
  result->model = readMachineModel(file);
  const Remains after = remainsOf(bench, result->model);
  result->after = after.gap;
  addGaps(bench.fitted(), before.fit, after.fit, false, &result->gaps);
  addGaps(bench.heldout(), before.heldout, after.heldout, true, &result->gaps);
  addChannelShares(bench, before, after, result);
  addCurves(bench.fitted(), before.fit, after.fit, result);
}

}  // namespace smartmill::discrepancy
