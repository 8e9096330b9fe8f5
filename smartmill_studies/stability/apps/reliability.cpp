// rosrun smartmill_studies stability_reliability MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D -o bins.csv

#include <cstdio>
#include <fstream>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/picture.h"
#include "stability/reliability.h"
#include "stability/study_request.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  int machines = 200, draws = 200, bins = 4;
  bool solver_only = false;
};

void run(const Request& request) {
  const MachineModel model = request.machine();
  stability::ReliabilityOptions options{request.range()};
  if (request.bins < 1 || request.bins > 100) throw Error("--bins: 1..100 is due");
  options.machines = request.machines;
  options.draws = request.draws;
  options.by_twin = !request.solver_only;
  const auto points = reliabilityStudy(model, request.system(model), options, [](double share) {
    std::fprintf(stderr, "\r%3.0f %%", 100.0 * share);
  });
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
      "yrange [0:1]\nset size square\nplot x with lines dt 2 lc 'gray' title 'as predicted', %FILE skip 1 "
      "using "
      "1:2:3:4 with yerrorbars pt 7 lw 2 title 'observed, 95 % of the binomial'");
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Reliability diagram of the probability of chatter: machines drawn from the model's standard "
      "deviations, each cut once in the simulator."};
  request.addTo(line);
  line.option("--machines", request.machines, "drawn (200)");
  line.option("--draws", request.draws, "behind each prediction (200)");
  line.option("--bins", request.bins, "of the predicted probability (4)");
  line.flag("--solver-only", request.solver_only, "the solver is the observer too, no simulator");
  request.addOutTo(line, "the diagram");
  return runProgram(line, argc, argv, [&] { run(request); });
}
