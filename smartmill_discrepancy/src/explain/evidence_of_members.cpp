#include "smartmill_discrepancy/explain/evidence_of_members.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace smartmill::discrepancy {

Trace traceOf(const Fitter& fitter, const Fit& fit, std::size_t member) {
  const auto simulated =
      fitter.runner().simulate({fitter.model(fit.state), fitter.model(without(fit.state, member))});
  Trace trace;
  trace.values.resize(fitter.runner().size());
  std::map<std::size_t, std::pair<double, double>> by_test;  // squares, product with the residual
  for (const Block& b : fitter.runner().blocks()) {
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      const double s = simulated[0][i] - simulated[1][i];
      trace.values[i] = s;
      trace.total += s * s;
      by_test[b.test].first += s * s;
      by_test[b.test].second += s * fit.residual[i];
    }
  }
  if (trace.total <= 0.0) return trace;
  double variance = 0.0, count = 0.0;
  for (const auto& [test, sums] : by_test) {
    if (sums.first < 1e-6 * trace.total) continue;
    variance += sums.second * sums.second / sums.first;
    count += 1.0;
  }
  trace.evenness = std::max(0.0, (variance - count) / trace.total);
  return trace;
}

double heldoutReduction(const Workbench& bench, const FitState& state, std::size_t member) {
  const TwinRunner& heldout = bench.heldout();
  const auto left = [&](const FitState& at) {
    return squaresLeft(heldout, heldout.simulate(bench.exact().model(at)));
  };
  const double with = left(state), without_it = left(without(state, member));
  const auto floor = static_cast<double>(heldout.size());
  if (without_it <= floor) return 0.0;
  return std::clamp(1.0 - std::max(with - floor, 0.0) / (without_it - floor), -1.0, 1.0);
}

double confidenceBetween(const Fitter& fitter, const FitState& better, const FitState& other) {
  const TwinRunner& runner = fitter.runner();
  const auto simulated = runner.simulate({fitter.model(better), fitter.model(other)});
  std::map<std::size_t, std::pair<double, double>> by_test;  // gain, squares between the two
  for (const Block& b : runner.blocks()) {
    auto& [gain, between] = by_test[b.test];
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      const double m = runner.measured()[i], x = simulated[0][i], y = simulated[1][i];
      gain += (m - y) * (m - y) - (m - x) * (m - x);
      between += (x - y) * (x - y);
    }
  }
  // A gain of one test that is far beyond the others' counts no more than they do.
  double sum = 0.0, squares = 0.0;
  for (const auto& [test, values] : by_test) {
    if (values.second < 4.0) continue;  // nothing that the noise would not hide
    const double vote = values.first / std::sqrt(values.second * (4.0 + values.second));
    sum += vote;
    squares += vote * vote;
  }
  return squares > 0.0 ? 0.5 * std::erfc(-sum / std::sqrt(2.0 * squares)) : 0.5;
}

}  // namespace smartmill::discrepancy
