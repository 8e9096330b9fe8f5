// Speed of the twin on one core: real_time_factor is seconds of record per second.

#include <benchmark/benchmark.h>

#include "smartmill_core/units.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/twin.h"

namespace {

using namespace smartmill;

MachineModel mill(bool flexible) {
  MachineModel model;
  model.tool = ToolGeometry{4, 19.05e-3, units::radFromDeg(30.0), {}};
  model.cutting = CuttingCoefficients{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    model.force_sensor.axis[axis].modes = {{930.0 + 300.0 * static_cast<double>(axis), 0.03, 0.9}};
    model.force_sensor.axis[axis].direct = 0.1;
  }
  if (flexible) {
    model.tool_tip.x.modes = {{1210.0, 0.031, 1.0 / 28e6}};
    model.tool_tip.y.modes = {{1180.0, 0.029, 1.0 / 31e6}};
  }
  Spindle spindle;
  spindle.viscous = 3.7e-4;
  spindle.load_meter_gain = 3.88e-4;
  spindle.load_meter_bandwidth = 7.0;
  spindle.load_meter_resolution = 3e-4;
  model.spindle = spindle;
  return model;
}

// A slot at 25.6 kHz, noise off. Arguments: flexible tool, runout.
void simulateSlot(benchmark::State& state) {
  MachineModel model = mill(state.range(0) != 0);
  if (state.range(1) != 0)
    model.effects.push_back(effectEntry("runout", {{"offset_um", 8.0}, {"angle_deg", 30.0}}));
  CampaignTest test;
  test.kind = TestKind::cut;
  test.sample_rate = 25600.0;
  test.spindle_speed = units::radPerSecFromRpm(4500.0);
  test.engagement = Engagement{0.0, units::PI, 2e-3, 6e-5};
  sim::SimulationOptions options;
  options.noise = false;
  const double duration = 0.2;
  for (auto _ : state) benchmark::DoNotOptimize(sim::simulateTest(model, test, duration, options));
  state.counters["real_time_factor"] =
      benchmark::Counter(duration * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(simulateSlot)
    ->ArgNames({"flexible", "runout"})
    ->Args({0, 0})
    ->Args({0, 1})
    ->Args({1, 0})
    ->Args({1, 1})
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
