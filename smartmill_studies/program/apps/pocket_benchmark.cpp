// Speed of the engagement of an NC program on one core: real_time_factor is seconds of machining per second.
// The program is a pocket of 102 x 62 x 10 mm in five levels with a tool of 10 mm: helical entries,
// rectangles with round corners.

#include <string>

#include <unistd.h>

#include <benchmark/benchmark.h>

#include "program/ring_pocket.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/units.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/program_analysis.h"

namespace {

using namespace smartmill;
using namespace smartmill::program;
using units::MM;

/// A model file of a mill with a tool of 10 mm.
std::string modelFile() {
  const std::string file = formatted("/tmp/pocket_benchmark_%d.yaml", static_cast<int>(getpid()));
  writeText(file,
            "format: smartmill-model/1\ntool: {teeth: 4, diameter_mm: 10.0, helix_deg: 30.0}\ncutting: "
            "{Ktc_n_per_mm2: 796.0, "
            "Krc_n_per_mm2: 168.0, Kac_n_per_mm2: 222.0, Kte_n_per_mm: 27.7, Kre_n_per_mm: 30.8, "
            "Kae_n_per_mm: 1.4}\n"
            "tool_tip:\n  x: [{frequency_hz: 1210.0, damping_ratio: 0.031, stiffness_n_per_um: 28.0}]\n"
            "  y: [{frequency_hz: 1180.0, damping_ratio: 0.029, stiffness_n_per_um: 31.0}]\n");
  return file;
}

// Arguments: length of the chords [um], 0: lines and arcs; width of a column [um]; stability limits.
void simulatePocket(benchmark::State& state) {
  const std::string pocket = ringPocket(static_cast<double>(state.range(0)) * units::UM);
  const std::string file = modelFile();
  AnalysisOptions options;
  options.stability = state.range(2) != 0;
  double machining = 0.0;
  for (auto _ : state) {
    ToolModels models({file});
    Stock stock(StockBlock{{0, 0, -20 * MM}, {120 * MM, 80 * MM, 0}},
                static_cast<double>(state.range(1)) * units::UM);
    machining +=
        ProgramAnalysis("pocket", models, stock, options).run(interpretProgram(pocket, "pocket")).time;
  }
  ::unlink(file.c_str());
  state.counters["real_time_factor"] = benchmark::Counter(machining, benchmark::Counter::kIsRate);
}

BENCHMARK(simulatePocket)
    ->ArgNames({"chord_um", "column_um", "stability"})
    ->Args({0, 100, 0})
    ->Args({0, 100, 1})
    ->Args({1000, 100, 1})
    ->Args({200, 100, 0})
    ->Args({200, 100, 1})
    ->Args({0, 200, 1})
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
