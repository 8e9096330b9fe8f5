// Cost of a sample: 3 modes and 12 harmonics, beside the same filter as one dense fixed-size product.

#include <benchmark/benchmark.h>
#include <Eigen/Core>

#include "smartmill_core/units.h"
#include "smartmill_kalman/harmonic_filter.h"
#include "smartmill_kalman/reference_case.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0, SPEED = units::TWO_PI * 150.0;
constexpr int HARMONICS = 12, STATES = 6 + 1 + 2 * HARMONICS;

HarmonicFilter filterOf() {
  HarmonicFilterParameters parameters;
  parameters.max_harmonics = HARMONICS;
  return HarmonicFilter(ReferenceCase::exactSensor(), SPEED, RATE, parameters);
}

void blockStructured(benchmark::State& state) {
  HarmonicFilter filter = filterOf();
  double sample = 0.0;
  for (auto _ : state) {
    sample = 1.0 - sample;
    benchmark::DoNotOptimize(filter.step(sample));
  }
}
BENCHMARK(blockStructured);

void denseFixedSize(benchmark::State& state) {
  using Matrix = Eigen::Matrix<double, STATES, STATES>;
  using Vector = Eigen::Matrix<double, STATES, 1>;
  // The numbers do not matter for the cost; a contraction keeps them finite.
  Matrix transition = 0.02 * Matrix::Random();
  const Vector gain = 0.1 * Vector::Random(), output = Vector::Random(), force = Vector::Random();
  Vector x = Vector::Zero();
  double sample = 0.0;
  for (auto _ : state) {
    sample = 1.0 - sample;
    const Vector filtered = x + gain * (sample - output.dot(x));
    benchmark::DoNotOptimize(force.dot(filtered));
    x.noalias() = transition * filtered;
    benchmark::DoNotOptimize(x);
  }
}
BENCHMARK(denseFixedSize);

}  // namespace
}  // namespace smartmill::kalman

BENCHMARK_MAIN();
