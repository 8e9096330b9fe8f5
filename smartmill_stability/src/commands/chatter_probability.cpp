#include "smartmill_stability/commands.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
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
  if (!(request.risk >= 0.0) || !(request.risk < 1.0)) throw Error("--risk: expected 0 <= value < 1");
  const MachineModel model = request.machine();
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
  for (std::size_t s = 0; s < speeds.size(); ++s)
    for (std::size_t d = 0; d < depths.size(); ++d)
      csv.row(units::rpmFromRadPerSec(speeds[s]), depths[d] / units::MM, chart.probability[s][d],
              chart.nominal[s] / units::MM);
  csv.save(request.out);
  stability::drawProbabilities(request.out, depths.size(), depths.back(), "limit of the nominal system");
  std::printf(
      "robust points (probability of chatter at most %.0f %% within %.1f %% of the speed, %d draws):\n",
      100.0 * request.risk, 100.0 * request.speed_margin, request.draws);
  for (const auto& p : stability::robustPoints(chart, request.risk, request.speed_margin, request.points))
    std::printf("  %8.1f rpm %8.4f mm  %4.1f %%\n", units::rpmFromRadPerSec(p.speed), p.depth / units::MM,
                100.0 * p.probability);
}

}  // namespace

namespace smartmill::stability {

Command chatterProbabilityCommand() {
  Command command("chatter-probability", "computes the probability of chatter over speed and depth");
  command.description =
      "Probability of chatter over speed and depth, from the standard deviations of a machine model.";
  command.examples = {
      {"mill.yaml --entry-deg 0 --exit-deg 180 --speeds 4000:9000:101 --depths-mm 0.1:3:30 -o "
       "grid.csv",
       "a map, and robust points at a risk of 5 %"}};
  command.files = {
      {"OUT", "CSV rpm,depth_mm,probability,nominal_limit_mm; a picture of the same name with .png"}};
  command.setBody(run, [](CommandLine& line, Request& request) {
    request.addTo(line, "LO:HI:N");
    line.option("--depths-mm", request.depths, "LO:HI:N [mm]").required();
    line.option("--draws", request.draws, "number of drawn machines").showDefault();
    line.option("--seed", request.seed, "seed of the draws").showDefault();
    line.option("--risk", request.risk, "largest probability of chatter of robust points").showDefault();
    line.option("--speed-margin", request.speed_margin, "relative error of the speed on both sides")
        .showDefault();
    line.option("--points", request.points, "largest number of robust points").showDefault();
    request.addOutTo(line);
  });
  return command;
}

}  // namespace smartmill::stability
