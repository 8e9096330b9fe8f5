// rosrun smartmill_studies stability_reliability MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D -o bins.csv

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/picture.h"
#include "stability/reliability.h"
#include "stability/study_request.h"
#include "study_case.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  int machines = 200, draws = 200, bins = 4;
  bool solver_only = false;
  StudyCase one;
};

/// One random machine with its own seed.
void runOne(const Request& request, const MachineModel& model, stability::ReliabilityOptions options) {
  request.one.check(request.machines);
  options.machines = 1;
  options.seed = static_cast<unsigned>(seedOfCase(options.seed, request.one.number));
  const stability::ReliabilityPoint p = reliabilityStudy(model, request.system(model), options).front();
  request.one.print({{"case", request.one.number},
                     {"speed_rpm", units::rpmFromRadPerSec(p.speed)},
                     {"depth_mm", p.depth / units::MM},
                     {"predicted", p.predicted},
                     {"chatters", p.chatters},
                     {"seen", p.observed_chatter}});
}

/// Points from the printed lines of the cases.
std::vector<stability::ReliabilityPoint> pointsOf(const std::string& file) {
  std::vector<stability::ReliabilityPoint> points;
  for (const nlohmann::json& line : readJsonLines(file)) {
    stability::ReliabilityPoint p;
    p.speed = units::radPerSecFromRpm(line.at("speed_rpm"));
    p.depth = line.at("depth_mm").get<double>() * units::MM;
    p.predicted = line.at("predicted");
    p.chatters = line.at("chatters");
    p.observed_chatter = line.at("seen");
    points.push_back(p);
  }
  return points;
}

void report(const Request& request, const std::vector<stability::ReliabilityPoint>& points) {
  const bool by_twin = !request.solver_only;
  const auto bins = reliabilityBins(points, request.bins, by_twin);
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
      points.size(), by_twin ? "in the simulator's records" : "by the solver",
      reliabilityScore(points, by_twin), outside);
  stability::drawPicture(
      request.out,
      "set xlabel 'Predicted probability of chatter'\nset ylabel 'Observed share'\nset xrange [0:1]\nset "
      "yrange [0:1]\nset size square\nplot x with lines dt 2 lc 'gray' title 'as predicted', %FILE skip 1 "
      "using "
      "1:2:3:4 with yerrorbars pt 7 lw 2 title 'observed, 95 % of the binomial'");
}

void run(const Request& request) {
  const MachineModel model = request.machine();
  stability::ReliabilityOptions options{request.range()};
  if (request.bins < 1 || request.bins > 100) throw Error("--bins: expected 1..100");
  options.machines = request.machines;
  options.draws = request.draws;
  options.by_twin = !request.solver_only;
  if (request.one.scores()) return report(request, pointsOf(request.one.lines));
  if (request.one.one()) return runOne(request, model, options);
  const auto points = reliabilityStudy(model, request.system(model), options, [](double share) {
    std::fprintf(stderr, "\r%3.0f %%", 100.0 * share);
  });
  std::fprintf(stderr, "\n");
  report(request, points);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Reliability diagram of the probability of chatter: machines drawn from the standard deviations of the "
      "model, with one simulated cut each."};
  request.addTo(line);
  request.one.addTo(line, "--machines,--cases", request.machines, "drawn");
  request.one.addScore(line);
  line.option("--draws", request.draws, "draws per prediction (200)");
  line.option("--bins", request.bins, "bins of the predicted probability (4)");
  line.flag("--solver-only", request.solver_only, "observe by the solver instead of the simulator");
  request.addOutTo(line, "the diagram");
  return runProgram(line, argc, argv, [&] { run(request); });
}
