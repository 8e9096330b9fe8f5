#include "smartmill_discrepancy/explain/outcome.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/signal/statistics.h"

namespace smartmill::discrepancy {
namespace {

double rmsOf(const std::vector<double>& v, std::size_t from, std::size_t size) {
  double squares = 0.0;
  for (std::size_t i = from; i < from + size; ++i) squares += v[i] * v[i];
  return size ? std::sqrt(squares / static_cast<double>(size)) : 0.0;
}

// Gap of all spans except chattering cuts.
// By chattering cut.
std::map<std::string, double> predictionErrors(const TwinRunner& runner,
                                               const std::vector<double>& residual) {
  const std::array<const char*, 4> compared{{"fx", "fy", "tool_x", "tool_y"}};
  std::map<std::string, double> errors;
  for (const ChannelSpan& b : runner.spans()) {
    if (b.in_gap || b.slow || std::find(compared.begin(), compared.end(), b.channel) == compared.end())
      continue;
    const TestData& test = runner.data().tests[b.test];
    const auto from = static_cast<std::ptrdiff_t>(b.offset + test.first_cut),
               to = static_cast<std::ptrdiff_t>(b.offset + b.size);
    const double all = standardDeviation({runner.measured().begin() + from, runner.measured().begin() + to});
    double& error = errors[test.test.name];
    error = std::max(error, rmsOf(residual, b.offset + test.first_cut, b.size - test.first_cut) / all);
  }
  return errors;
}

// The chi-square statistic of noise alone has the relative deviation sqrt(2 / n).
double floorDeviation(std::size_t samples) {
  return samples ? std::sqrt(0.5 / static_cast<double>(samples)) : 0.0;
}

void addGaps(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
             bool heldout, std::vector<TestGap>* gaps) {
  for (const ChannelSpan& b : runner.spans()) {
    if (!b.in_gap) continue;
    gaps->push_back({runner.data().tests[b.test].test.name, b.channel, heldout,
                     rmsOf(before, b.offset, b.size), rmsOf(after, b.offset, b.size),
                     floorDeviation(b.size)});
  }
}

}  // namespace

double gapOf(const TwinRunner& runner, const std::vector<double>& residual) {
  double squares = 0.0;
  std::size_t samples = 0;
  for (const ChannelSpan& b : runner.spans()) {
    if (!b.in_gap) continue;
    squares += std::pow(rmsOf(residual, b.offset, b.size), 2) * static_cast<double>(b.size);
    samples += b.size;
  }
  return samples ? std::sqrt(squares / static_cast<double>(samples)) : 0.0;
}

ModelResidual residualOf(const Workbench& bench, const MachineModel& model) {
  ModelResidual r{residualOf(bench.fitted(), model), residualOf(bench.heldout(), model), {}, {}};
  r.gap = {gapOf(bench.fitted(), r.fit), gapOf(bench.heldout(), r.heldout)};
  r.chattering = predictionErrors(bench.fitted(), r.fit);
  return r;
}

void writeOutcome(const Workbench& bench, const ModelResidual& before, const MachineModel& improved,
                  const std::string& folder, Explanation* result) {
  const std::string file = folder + "/model.yaml";
  writeMachineModel(improved, file);
  result->model = readMachineModel(file);
  const ModelResidual after = residualOf(bench, result->model);
  result->after = after.gap;
  for (const TestData& t : bench.data().tests) {
    if (t.chatter)
      result->chattering.push_back({t.test.name, t.chatter->frequency, t.chatter->amplitude,
                                    before.chattering.at(t.test.name), after.chattering.at(t.test.name)});
  }
  addGaps(bench.fitted(), before.fit, after.fit, false, &result->gaps);
  addGaps(bench.heldout(), before.heldout, after.heldout, true, &result->gaps);
  addChannelShares(bench, before, after, result);
  addCurves(bench.fitted(), before.fit, after.fit, result);
}

}  // namespace smartmill::discrepancy
