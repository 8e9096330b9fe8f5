// Speed of the engagement of an NC program on one core: real_time_factor is seconds of machining per second.
// The program is a pocket of 102 x 62 x 10 mm in five levels with a tool of 10 mm: helical entries,
// rectangles with round corners.

#include <algorithm>
#include <cmath>
#include <string>

#include <unistd.h>

#include <benchmark/benchmark.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/units.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/program_analysis.h"

namespace {

using namespace smartmill;
using namespace smartmill::program;
using units::MM;
using units::PI;

constexpr double X = 60.0, Y = 40.0;  // [mm] centre of the pocket

/// Blocks of lines and arcs, or of chords of a length [mm].
class PocketProgram {
 public:
  explicit PocketProgram(double chord) : chord_(chord) {
    text_ = "G21 G90 G17\nS6000 M3\nG0 X62 Y40 Z5\n";
    for (int level = 0; level < 5; ++level) addLevel(-2.0 * level);
    text_ += "M30\n";
  }
  const std::string& text() const { return text_; }

 private:
  void addLevel(double top) {
    text_ += formatted("G0 X62 Y40 Z%.1f\nG1 Z%.1f F600\nG3 Z%.1f I-2 F800\nG3 Z%.1f I-2\nG3 I-2 F1800\n",
                       top + 1, top, top - 1, top - 2);
    x_ = X + 2.0;
    y_ = Y;
    for (int loop = 1; loop <= 6; ++loop) {
      const double h = 2.0 + 4.0 * loop, w = h + 20.0, r = 2.0;
      line(X + w, Y);
      line(X + w, Y + h - r);
      corner(X + w - r, Y + h - r, r, 0.0);
      line(X - w + r, Y + h);
      corner(X - w + r, Y + h - r, r, 0.5 * PI);
      line(X - w, Y - h + r);
      corner(X - w + r, Y - h + r, r, PI);
      line(X + w - r, Y - h);
      corner(X + w - r, Y - h + r, r, 1.5 * PI);
      line(X + w, Y);
    }
    text_ += "G0 Z5\n";
  }
  void line(double x, double y) {
    const int count = chord_ > 0.0 ? std::max(1, static_cast<int>(std::hypot(x - x_, y - y_) / chord_)) : 1;
    for (int k = 1; k <= count; ++k)
      text_ += formatted("G1 X%.4f Y%.4f\n", x_ + (x - x_) * k / count, y_ + (y - y_) * k / count);
    x_ = x;
    y_ = y;
  }
  void corner(double cx, double cy, double r, double from) {
    const double x = cx + r * std::cos(from + 0.5 * PI), y = cy + r * std::sin(from + 0.5 * PI);
    if (chord_ == 0.0) text_ += formatted("G3 X%.4f Y%.4f R%.4f\n", x, y, r);
    const int count = chord_ > 0.0 ? std::max(1, static_cast<int>(0.5 * PI * r / chord_)) : 0;
    for (int k = 1; k <= count; ++k) {
      const double angle = from + 0.5 * PI * k / count;
      text_ += formatted("G1 X%.4f Y%.4f\n", cx + r * std::cos(angle), cy + r * std::sin(angle));
    }
    x_ = x;
    y_ = y;
  }

  std::string text_;
  double chord_, x_ = X, y_ = Y;
};

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
  const PocketProgram pocket(static_cast<double>(state.range(0)) * 1e-3);
  const std::string file = modelFile();
  AnalysisOptions options;
  options.stability = state.range(2) != 0;
  double machining = 0.0;
  for (auto _ : state) {
    ToolModels models({file});
    Stock stock({{0, 0, -20 * MM}, {120 * MM, 80 * MM, 0}}, static_cast<double>(state.range(1)) * units::UM);
    machining +=
        ProgramAnalysis("pocket", models, stock, options).run(interpretProgram(pocket.text(), "pocket")).time;
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
