// rosrun smartmill_studies stability_reliability MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D -o bins.csv

#include <cstdio>
#include <fstream>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/picture.h"
#include "smartmill_stability/solvers/model_system.h"
#include "stability/reliability.h"

namespace {

using namespace smartmill;

struct Request {
  std::string model, speeds, out;
  double entry_deg = 0.0, exit_deg = 180.0, max_depth_mm = 0.0;
  int machines = 200, draws = 200, bins = 4;
  unsigned seed = 1;
  bool solver_only = false;
};

void run(const Request& request) {
  const MachineModel model = readMachineModel(request.model);
  const stability::RegenerativeSystem system =
      stability::systemOf(model, request.entry_deg, request.exit_deg);
  stability::ReliabilityOptions options;
  double low = 0.0, high = 0.0;
  char rest = 0;
  if (std::sscanf(request.speeds.c_str(), "%lf:%lf%c", &low, &high, &rest) != 2)
    throw Error("--speeds " + request.speeds + ": LO:HI is due");
  if (request.bins < 1 || request.bins > 100) throw Error("--bins: 1..100 is due");
  options.speed_low = units::radPerSecFromRpm(low);
  options.speed_high = units::radPerSecFromRpm(high);
  options.max_depth = request.max_depth_mm * units::MM;
  options.machines = request.machines;
  options.draws = request.draws;
  options.seed = request.seed;
  options.by_twin = !request.solver_only;
  const auto points = reliabilityStudy(
      model, system, options, [](double share) { std::fprintf(stderr, "\r%3.0f %%", 100.0 * share); });
  std::fprintf(stderr, "\n");
  const auto bins = reliabilityBins(points, request.bins, options.by_twin);
  std::ofstream csv(request.out);
  csv << "predicted,observed,low,high,count\n";
  std::printf("%10s %10s %19s %6s\n", "predicted", "observed", "95 % of observed", "cuts");
  int outside = 0;
  for (const stability::ReliabilityBin& bin : bins) {
    if (bin.count == 0) continue;
    std::printf("%10.3f %10.3f     %6.3f .. %6.3f %6d%s\n", bin.predicted, bin.observed, bin.low, bin.high,
                bin.count, bin.holds() ? "" : "  outside");
    csv << bin.predicted << ',' << bin.observed << ',' << bin.low << ',' << bin.high << ',' << bin.count
        << '\n';
    outside += !bin.holds();
  }
  csv.close();
  if (!csv) throw Error(request.out + ": cannot be written");
  std::printf(
      "%zu machines, observed %s: all together %+.2f standard errors, %d bins outside their interval\n",
      points.size(), options.by_twin ? "in the simulator's records" : "by the solver",
      reliabilityScore(points, options.by_twin), outside);
  stability::drawBeside(
      request.out,
      "set xlabel 'Predicted probability of chatter'\nset ylabel 'Observed share'\nset xrange [0:1]\nset "
      "yrange "
      "[0:1]\nset size square\nplot x with lines dt 2 lc 'gray' title 'as predicted', %FILE skip 1 using "
      "1:2:3:4 with yerrorbars pt 7 lw 2 title 'observed, 95 % of the binomial'");
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Reliability diagram of the probability of chatter: machines drawn from the model's standard "
      "deviations, "
      "each cut once in the simulator."};
  line.option("model", request.model, "machine model file with tool, cutting and tool_tip").required();
  line.option("--entry-deg", request.entry_deg, "immersion angle at which a tooth enters [deg]").required();
  line.option("--exit-deg", request.exit_deg, "immersion angle at which a tooth leaves [deg]").required();
  line.option("--speeds", request.speeds, "LO:HI [rpm]").required();
  line.option("--max-depth-mm", request.max_depth_mm, "limits are looked for up to here [mm]").required();
  line.option("--machines", request.machines, "drawn (200)");
  line.option("--draws", request.draws, "behind each prediction (200)");
  line.option("--bins", request.bins, "of the predicted probability (4)");
  line.option("--seed", request.seed, "(1)");
  line.flag("--solver-only", request.solver_only, "the solver is the observer too, no simulator");
  line.option("-o,--out", request.out, "CSV file; the diagram of the same name with .png stands beside it")
      .required();
  return runProgram(line, argc, argv, [&] { run(request); });
}
