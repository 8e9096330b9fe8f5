#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/picture.h"
#include "smartmill_stability/commands.h"
#include "smartmill_stability/learning/chart_learning.h"
#include "smartmill_stability/solvers/model_system.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

struct Request {
  std::string cuts, model, speeds, out;
  int teeth = 0;
  double diameter_mm = 0.0, helix_deg = 0.0, entry_deg = 0.0, exit_deg = 0.0, max_depth_mm = 0.0;
  LearningOptions learning;
};

RegenerativeSystem cutOf(const Request& request) {
  RegenerativeSystem cut;
  cut.teeth = request.teeth;
  cut.diameter = request.diameter_mm * units::MM;
  cut.helix = units::radFromDeg(request.helix_deg);
  cut.entry = units::radFromDeg(request.entry_deg);
  cut.exit = units::radFromDeg(request.exit_deg);
  if (!(cut.exit > cut.entry)) throw Error("--exit-deg: expected more than --entry-deg");
  return cut;
}

/// [rad/s] of LO:HI.
CutRange rangeOfCuts(const Request& request) {
  double low = 0.0, high = 0.0;
  char rest = 0;
  if (std::sscanf(request.speeds.c_str(), "%lf:%lf%c", &low, &high, &rest) != 2 || !(low > 0.0) ||
      !(high > low))
    throw UsageError("--speeds " + request.speeds + ": expected LO:HI [rpm] with 0 < LO < HI");
  if (!(request.max_depth_mm > 0.0)) throw Error("--max-depth-mm: expected a value above 0");
  return {units::radPerSecFromRpm(low), units::radPerSecFromRpm(high), request.max_depth_mm * units::MM};
}

void writeChart(const Request& request, const CutRange& range, const ChartLearning& learning) {
  constexpr int SPEEDS = 201, DEPTHS = 60;
  std::vector<double> speeds, depths;
  for (int k = 0; k < SPEEDS; ++k)
    speeds.push_back(range.speed_low + (range.speed_high - range.speed_low) * k / (SPEEDS - 1));
  // As deep as twice the deepest cut of interest, up to the largest depth.
  double deepest = 0.0;
  for (const JudgedCut& cut : learning.cuts()) deepest = std::max(deepest, 1.2 * cut.depth);
  if (const auto best = learning.recommended()) deepest = std::max(deepest, 2.0 * best->depth);
  deepest = deepest > 0.0 ? std::min(deepest, range.max_depth) : range.max_depth;
  for (int k = 1; k <= DEPTHS; ++k) depths.push_back(deepest * k / DEPTHS);
  const ProbabilityChart chart = learning.chart(speeds, depths);
  CsvWriter csv("rpm,depth_mm,probability,median_limit_mm", 8);
  for (std::size_t s = 0; s < speeds.size(); ++s)
    for (std::size_t d = 0; d < depths.size(); ++d)
      csv.row(units::rpmFromRadPerSec(speeds[s]), depths[d] / units::MM, chart.probability[s][d],
              chart.nominal[s] / units::MM);
  csv.save(request.out);
  std::string marks;
  for (const JudgedCut& cut : learning.cuts())
    marks += formatted("set label '' at %.6g,%.6g point pt %d ps 2 lw 2 lc '%s' front\n",
                       units::rpmFromRadPerSec(cut.speed), cut.depth / units::MM, cut.chatter ? 2 : 6,
                       cut.chatter ? "black" : "blue");
  if (const auto best = learning.recommended())
    marks += formatted("set label ' recommended' at %.6g,%.6g point pt 7 ps 1.5 lc 'blue' front\n",
                       units::rpmFromRadPerSec(best->speed), best->depth / units::MM);
  drawProbabilities(request.out, DEPTHS, deepest, "limit with a probability of one half", marks);
}

void print(const char* what, const CutProposal& cut) {
  std::printf("%s: %.0f rpm, %.3f mm, stable with a probability of %.0f +- %.0f %%\n", what,
              units::rpmFromRadPerSec(cut.speed), cut.depth / units::MM, 100.0 * cut.stable,
              100.0 * cut.std_dev);
}

void printEstimate(const MachineEstimate& found) {
  constexpr const char* AXIS[] = {"x", "y"};
  for (std::size_t axis = 0; axis < 2; ++axis)
    std::printf(
        "most flexible mode along %s: %.0f Hz +- %.0f %%, %.3g N/um +- %.0f %%, damping ratio %.3f +- %.0f "
        "%%\n",
        AXIS[axis], found.frequency[axis].median, 100.0 * found.frequency[axis].log_std,
        found.stiffness[axis].median / units::N_PER_UM, 100.0 * found.stiffness[axis].log_std,
        found.damping[axis].median, 100.0 * found.damping[axis].log_std);
  std::printf("tangential coefficient: %.0f N/mm2 +- %.0f %%; least limit: %.3f mm +- %.0f %%\n",
              found.kt.median / units::N_PER_MM2, 100.0 * found.kt.log_std, found.limit.median / units::MM,
              100.0 * found.limit.log_std);
}

void run(const Request& request) {
  const CutRange range = rangeOfCuts(request);
  const RegenerativeSystem cut = cutOf(request);
  const std::vector<JudgedCut> cuts =
      request.cuts.empty() ? std::vector<JudgedCut>{} : readJudgedCuts(request.cuts);
  const MachinePrior prior = request.model.empty()
                                 ? MachinePrior::wide(cut)
                                 : MachinePrior::about(readMachineModel(request.model), cut);
  ChartLearning learning(prior, range, request.learning);
  for (const JudgedCut& made : cuts) learning.add(made);
  print("next cut", learning.next());
  if (const auto best = learning.recommended())
    print("recommended", *best);
  else
    std::printf("recommended: no cut yet with a probability of chatter of at most %.0f %%\n",
                100.0 * request.learning.risk);
  printEstimate(learning.estimate());
  if (!request.out.empty()) writeChart(request, range, learning);
}

}  // namespace

namespace smartmill::stability {

Command lobesFromCutsCommand() {
  Command command("lobes-from-cuts", "learns a stability chart from cuts alone, and proposes the next cut");
  command.description =
      "Stability chart of a machine without a tap test, from cuts whose verdict is known, with the next cut "
      "to "
      "try and the recommended cut. Make the next cut, append its row to CUTS and repeat; five cuts suffice "
      "for "
      "most tools.";
  command.examples = {
      {"--teeth 3 --diameter-mm 12 --helix-deg 35 --entry-deg 90 --exit-deg 180 --speeds 4000:16000 "
       "--max-depth-mm 12",
       "the first cut"},
      {"--teeth 3 --diameter-mm 12 --helix-deg 35 --entry-deg 90 --exit-deg 180 --speeds 4000:16000 "
       "--max-depth-mm 12 --cuts cuts.csv -o chart.csv",
       "after some cuts: the next one, the recommended one, and the chart"}};
  command.files = {
      {"CUTS",
       "CSV rpm,depth_mm,verdict[,chatter_hz[,chatter_std_hz]][,kt_n_per_mm2,kt_std_n_per_mm2], the verdict "
       "stable or chatter; cells of the others may be empty"},
      {"MODEL",
       "machine model with modes of the tool tip and their standard deviations, for example of tool-frf"},
      {"OUT",
       "CSV rpm,depth_mm,probability,median_limit_mm (of chatter); a picture of the same name with .png"}};
  command.setBody(run, [](CommandLine& line, Request& request) {
    line.option("--cuts", request.cuts, "CSV file of the cuts made so far (default: none)");
    line.option("--teeth", request.teeth, "teeth of the tool").required().within(1, 20);
    line.option("--diameter-mm", request.diameter_mm, "diameter of the tool [mm]").required();
    line.option("--helix-deg", request.helix_deg, "helix of the tool [deg]").showDefault();
    line.option("--entry-deg", request.entry_deg, "immersion angle at which a tooth enters [deg]").required();
    line.option("--exit-deg", request.exit_deg, "immersion angle at which a tooth leaves [deg]").required();
    line.option("--speeds", request.speeds, "range of the spindle LO:HI [rpm]").required();
    line.option("--max-depth-mm", request.max_depth_mm, "largest depth to try [mm]").required();
    line.option("--model", request.model,
                "start from the modes and coefficients of this model instead of wide distributions");
    line.option("--risk", request.learning.risk, "largest probability of chatter of the recommended cut [1]")
        .showDefault();
    line.option("--seed", request.learning.seed, "seed of the draws").showDefault();
    line.option("-o,--out", request.out, "CSV file; a map of the same name with .png is drawn");
  });
  return command;
}

}  // namespace smartmill::stability
