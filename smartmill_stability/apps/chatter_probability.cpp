// rosrun smartmill_stability chatter_probability MODEL --entry-deg A --exit-deg B --speeds LO:HI:N
// --depths-mm LO:HI:N -o grid.csv

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/program.h"
#include "smartmill_stability/chart/cut_request.h"
#include "smartmill_stability/chart/picture.h"
#include "smartmill_stability/chart/uncertainty.h"
#include "smartmill_stability/solvers/model_system.h"

namespace {

using namespace smartmill;  // NOLINT

struct Request : stability::CutRequest {
  std::string depths;
  double risk = 0.05, speed_margin = 0.02;
  int draws = 60, points = 5;
  unsigned seed = 1;
};

void run(const Request& request) {
  if (!(request.risk >= 0.0) || !(request.risk < 1.0)) throw Error("--risk: 0 <= value < 1 is due");
  const MachineModel model = readMachineModel(request.model);
  const stability::RegenerativeSystem system = request.system(model);
  const std::vector<double> speeds = request.speedRange();
  std::vector<double> depths = stability::rangeOf("--depths-mm", request.depths);
  for (double& depth : depths) depth *= units::MM;
  const bool terminal = isatty(STDERR_FILENO);
  const auto chart = stability::probabilityChart(stability::UncertainSystem::of(model, system), speeds,
                                                 depths, request.draws, request.seed, [&](double share) {
                                                   if (terminal)
                                                     std::fprintf(stderr, "\r%3.0f %% of the draws%s",
                                                                  100.0 * share, share >= 1.0 ? "\n" : "");
                                                 });
  CsvWriter csv("rpm,depth_mm,probability,nominal_limit_mm", 8);
  for (std::size_t s = 0; s < speeds.size(); ++s) {
    if (s > 0) csv.gap();  // gnuplot's rows
    for (std::size_t d = 0; d < depths.size(); ++d)
      csv.row(units::rpmFromRadPerSec(speeds[s]), depths[d] / units::MM, chart.probability[s][d],
              chart.nominal[s] / units::MM);
  }
  csv.save(request.out);
  stability::drawBeside(
      request.out,
      "set xlabel 'Spindle speed [rpm]'\nset ylabel 'Axial depth [mm]'\nset cblabel 'Probability "
      "of chatter'\nset cbrange [0:1]\nset palette defined (0 'white', 0.05 'light-green', 0.5 "
      "'orange', 1 'dark-red')\nset view map\nset autoscale fix\n"
      "plot %FILE skip 1 using 1:2:3 with image notitle, %FILE skip 1 using 1:4 with lines lw 2 "
      "lc 'black' title 'limit of the nominal system'");
  std::printf(
      "robust points (probability of chatter at most %.0f %% within %.1f %% of the speed, %d draws):\n",
      100.0 * request.risk, 100.0 * request.speed_margin, request.draws);
  for (const auto& p : stability::robustPoints(chart, request.risk, request.speed_margin, request.points))
    std::printf("  %8.1f rpm %8.4f mm  %4.1f %%\n", units::rpmFromRadPerSec(p.speed), p.depth / units::MM,
                100.0 * p.probability);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Probability of chatter over speed and depth, from the standard deviations of a machine model."};
  request.addTo(line, "LO:HI:N");
  line.option("--depths-mm", request.depths, "LO:HI:N [mm]").required();
  line.option("--draws", request.draws, "machines drawn (60)");
  line.option("--seed", request.seed, "of the draws (1)");
  line.option("--risk", request.risk, "probability of chatter that robust points may have (0.05)");
  line.option("--speed-margin", request.speed_margin, "share of the speed to both sides (0.02)");
  line.option("--points", request.points, "robust points printed (5)");
  request.addOutTo(line);
  return runProgram(line, argc, argv, [&] { run(request); });
}
