// rosrun smartmill_studies loadmeter_rounding --cases 40 --seed 1 -o FOLDER

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "loadmeter/machine_cases.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

constexpr double MILLIVOLT = 1e-3;

struct Step {
  std::vector<double> thesis, ours;  // [%]
  double inside = 0.0;
};

Step tryStep(double volt, double noise, unsigned seed, int cases) {
  Faults faults;
  faults.resolution = volt;
  faults.noise = noise;
  faults.depth_error = 0.0;  // what remains is the meter's
  Step step;
  for (int i = 0; i < cases; ++i) {
    if (isatty(STDERR_FILENO))
      std::fprintf(stderr, "\r%.1f mV: case %d of %d ", volt / MILLIVOLT, i + 1, cases);
    const CaseErrors e = judge(drawCase(seed + static_cast<unsigned>(i), faults), faults);
    step.thesis.push_back(100.0 * std::abs(e.thesis_ktc));
    step.ours.push_back(100.0 * std::abs(e.ktc));
    step.inside += 100.0 * (std::abs(e.z_ktc) < 1.96) / cases;
  }
  return step;
}

void run(int cases, unsigned seed, double noise, const std::string& folder) {
  std::filesystem::create_directories(folder);
  std::vector<std::vector<double>> rows;
  std::printf("noise %.1f mV before rounding; error of Ktc [%%]\n%10s %21s %21s %8s\n", noise / MILLIVOLT,
              "step [mV]", "thesis median, 95 %", "package median, 95 %", "inside");
  for (const double step : {0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0}) {
    const Step s = tryStep(step * MILLIVOLT, noise, seed, cases);
    rows.push_back(
        {step, median(s.thesis), percentile(s.thesis, 0.95), median(s.ours), percentile(s.ours, 0.95)});
    std::printf("%10.1f %10.2f %10.2f %10.2f %10.2f %7.1f%%\n", step, rows.back()[1], rows.back()[2],
                rows.back()[3], rows.back()[4], s.inside);
  }
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\n");
  Gnuplot plot(folder + "/load_meter_rounding.png", 1000, 600, 12);
  plot.block("steps", rows);
  plot << "set grid\nset logscale xy\nset key top left\nset xlabel 'Rounding of the load meter [mV]'\n"
          "set ylabel 'Error of Ktc [%]'\nset arrow from 0.3, graph 0 to 0.3, graph 1 nohead dt 2 lc 'gray'\n"
          "plot $steps using 1:2 with linespoints lc 'gray' lw 2 title 'thesis to the letter, median', "
          "$steps using 1:3 with linespoints lc 'gray' dt 2 title '95 %', "
          "$steps using 1:4 with linespoints lc rgb '#0060ad' lw 2 title 'this package, median', "
          "$steps using 1:5 with linespoints lc rgb '#0060ad' dt 2 title '95 %'\n";
  plot.draw();
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Error of Ktc over the rounding of the load meter (0.3 mV as the thesis has it, and coarser).");
  int cases = 40;
  unsigned seed = 1;
  double noise = 0.2;
  std::string folder;
  line.option("--cases", cases, "drawn machines for each step").showDefault().within(4, 100000);
  line.option("--seed", seed, "of the first").showDefault();
  line.option("--noise-mv", noise, "before rounding, root mean square").showDefault().within(0.0, 1000.0);
  line.option("-o", folder, "folder of the picture").required();
  return runProgram(line, argc, argv, [&] { run(cases, seed, noise * MILLIVOLT, folder); });
}
