// Cost of the solvers on the benchmark system. Reference times (same benchmark, one core, published or
// measured elsewhere): full discretization in Octave 24.1 s and semi-discretization 112.6 s for 101 x 51
// points, about 1760 s for 401 x 201; numba 652 s for 400 x 200; zero-order from 8001 lines in Octave 620 ms.

#include <algorithm>
#include <cmath>
#include <random>

#include <benchmark/benchmark.h>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/chart/limit_continuation.h"
#include "smartmill_stability/solvers/boundary.h"
#include "smartmill_stability/solvers/model_system.h"
#include "smartmill_stability/solvers/solver.h"
#include "smartmill_stability_testing/benchmark.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

constexpr double MAX_DEPTH = 10e-3;

RegenerativeSystem slot(bool two_axes) {
  RegenerativeSystem system;
  system.modes = two_axes ? systemModes(smartmill::stability::benchmark(), smartmill::stability::benchmark())
                          : systemModes(smartmill::stability::benchmark(), 0);
  system.teeth = 2;
  system.kt = 6e8;
  system.kr = 2e8;
  return system;
}

std::vector<double> speeds(int count) {
  std::vector<double> list;
  for (int i = 0; i < count; ++i)
    list.push_back(units::radPerSecFromRpm(count == 1 ? 10000.0 : 5000.0 + 20000.0 * i / (count - 1)));
  return list;
}

/// Largest relative error of limits against a solution with twice the nodes.
double worst(const std::vector<Limit>& limits, const RegenerativeSystem& system,
             const std::vector<double>& at) {
  SolverOptions fine;
  fine.nodes = 24;
  const std::vector<Limit> exact = makeSolver(Method::collocation, system, fine)->limits(at, MAX_DEPTH);
  double error = 0.0;
  for (std::size_t i = 0; i < limits.size(); ++i) {
    if (std::isinf(exact[i].depth) && std::isinf(limits[i].depth)) continue;
    error = std::max(error, std::abs(limits[i].depth / exact[i].depth - 1.0));
  }
  return error;
}

/// 401 speeds: 1 or 2 degrees of freedom.
void Boundary401(benchmark::State& state) {
  const RegenerativeSystem system = slot(state.range(0) == 2);
  SolverOptions options;
  options.tolerance = 1e-5;
  const auto solver = makeSolver(Method::collocation, system, options);
  const std::vector<double> at = speeds(401);
  std::vector<Limit> limits;
  for (auto _ : state) limits = solver->limits(at, MAX_DEPTH);
  state.counters["worst_error_percent"] = 100.0 * worst(limits, system, at);
}
BENCHMARK(Boundary401)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond);

/// All multipliers of a 401 x 201 grid, as in the reference times.
void Grid401x201(benchmark::State& state) {
  const auto solver = makeFloquetSolver(Method::collocation, slot(state.range(0) == 2));
  const std::vector<double> at = speeds(401);
  double sum = 0.0;
  for (auto _ : state) {
    for (const double speed : at) {
      const auto here = solver->at(speed);
      for (int j = 1; j <= 201; ++j) sum += here->multiplier(MAX_DEPTH * j / 201).radius();
    }
  }
  benchmark::DoNotOptimize(sum);
}
BENCHMARK(Grid401x201)->Arg(1)->Unit(benchmark::kMillisecond)->Iterations(1);

/// The demonstration mill: entry angle [deg] to 180 deg, number of speeds. CPU time of both threads.
void ChartOfTheMill(benchmark::State& state) {
  const RegenerativeSystem system =
      systemOf(readMachineModel(MILL_FILE), static_cast<double>(state.range(0)), 180.0);
  constexpr double DEEPEST = 25e-3;
  std::vector<double> at;
  for (int i = 0; i < state.range(1); ++i)
    at.push_back(units::radPerSecFromRpm(2000.0 + 18000.0 * i / static_cast<double>(state.range(1) - 1)));
  StabilityLimit found;
  for (auto _ : state) found = limitsByContinuation(system, at, DEEPEST, ContinuationAccuracy::ofChart());
  const std::vector<Limit> exact = makeSolver(Method::collocation, system)->limits(at, DEEPEST);
  std::vector<double> errors;
  for (std::size_t i = 0; i < at.size(); ++i)
    if (std::isfinite(found.depth[i]) && std::isfinite(exact[i].depth))
      errors.push_back(std::abs(found.depth[i] / exact[i].depth - 1.0));
  std::sort(errors.begin(), errors.end());
  state.counters["99 % of the errors %"] = 100.0 * errors[errors.size() * 99 / 100];
  state.counters["largest error %"] = 100.0 * errors.back();
}
BENCHMARK(ChartOfTheMill)
    ->ArgsProduct({{0, 90, 150}, {300, 1500}})
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

void WholeBoundary(benchmark::State& state) {
  const auto solver = makeFloquetSolver(Method::collocation, slot(false));
  TraceOptions options;
  options.speed_low = units::radPerSecFromRpm(5000.0);
  options.speed_high = units::radPerSecFromRpm(25000.0);
  options.max_depth = MAX_DEPTH;
  for (auto _ : state) benchmark::DoNotOptimize(traceBoundary(*solver, options));
}
BENCHMARK(WholeBoundary)->Unit(benchmark::kMillisecond)->Iterations(1);

/// Measured receptance: noisy lines from 0 to 4 kHz.
void ZeroOrderFromFrf(benchmark::State& state) {
  const auto lines = static_cast<std::size_t>(state.range(0));
  ToolTipResponse tool;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 1e-9);
  const ModalModel model = smartmill::stability::benchmark();
  for (std::size_t i = 1; i <= lines; ++i) {
    const double f = 4000.0 * static_cast<double>(i) / static_cast<double>(lines);
    tool.frequency.push_back(f);
    tool.xx.push_back(model.response(f) + std::complex<double>(noise(random), noise(random)));
    tool.yy.push_back(model.response(f) + std::complex<double>(noise(random), noise(random)));
  }
  const RegenerativeProcess process{2, 0.0, units::PI, 6e8, 1.0 / 3.0};
  const std::vector<double> at = speeds(401);
  for (auto _ : state) benchmark::DoNotOptimize(zeroOrderLimit(process, tool, at));
  state.SetComplexityN(state.range(0));
}
BENCHMARK(ZeroOrderFromFrf)
    ->Arg(1001)
    ->Arg(2001)
    ->Arg(4001)
    ->Arg(8001)
    ->Unit(benchmark::kMillisecond)
    ->Complexity();

void CostOfModes(benchmark::State& state) {
  ModalModel model;
  for (int k = 0; k < state.range(0); ++k) model.modes.push_back({700.0 + 100.0 * k, 0.02, 5e-7 / (k + 1)});
  RegenerativeSystem system = slot(true);
  system.modes = systemModes(model, model);
  const auto solver = makeFloquetSolver(Method::collocation, system);
  const double speed = units::radPerSecFromRpm(10000.0);
  for (auto _ : state) benchmark::DoNotOptimize(solver->multiplier(speed, 1e-4));
  state.SetComplexityN(state.range(0));
}
BENCHMARK(CostOfModes)->RangeMultiplier(2)->Range(1, 8)->Unit(benchmark::kMicrosecond)->Complexity();

void CostOfNodes(benchmark::State& state) {
  SolverOptions options;
  options.nodes = static_cast<int>(state.range(0));
  const auto solver = makeFloquetSolver(Method::collocation, slot(true), options);
  const double speed = units::radPerSecFromRpm(10000.0);
  for (auto _ : state) benchmark::DoNotOptimize(solver->multiplier(speed, 1e-4));
  state.SetComplexityN(state.range(0));
}
BENCHMARK(CostOfNodes)
    ->Arg(8)
    ->Arg(12)
    ->Arg(16)
    ->Arg(24)
    ->Arg(40)
    ->Unit(benchmark::kMicrosecond)
    ->Complexity();

void CostOfSteps(benchmark::State& state) {
  SolverOptions options;
  options.steps = static_cast<int>(state.range(0));
  const auto solver = makeFloquetSolver(Method::semi_discretization, slot(true), options);
  const double speed = units::radPerSecFromRpm(10000.0);
  for (auto _ : state) benchmark::DoNotOptimize(solver->multiplier(speed, 1e-4));
  state.SetComplexityN(state.range(0));
}
BENCHMARK(CostOfSteps)->RangeMultiplier(4)->Range(100, 25600)->Unit(benchmark::kMicrosecond)->Complexity();

void CostOfSpeeds(benchmark::State& state) {
  const auto solver = makeSolver(Method::collocation, slot(true));
  const std::vector<double> at = speeds(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(solver->limits(at, MAX_DEPTH));
  state.SetComplexityN(state.range(0));
}
BENCHMARK(CostOfSpeeds)->RangeMultiplier(2)->Range(25, 200)->Unit(benchmark::kMillisecond)->Complexity();

}  // namespace

BENCHMARK_MAIN();
