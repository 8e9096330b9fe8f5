#include "smartmill_stability/chart/process_damping.h"

#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/io/csv.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/cut_request.h"
#include "smartmill_stability/commands.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

struct Request : CutRequest {
  std::string cuts;
  double scatter = ProcessDampingOptions{}.scatter;
  double limit_std = std::numeric_limits<double>::quiet_NaN();  // NaN: from the model
};

void run(const Request& request) {
  const MachineModel model = request.machine();
  const RegenerativeSystem system = request.system(model);
  const std::vector<JudgedCut> cuts = readJudgedCuts(request.cuts);
  ProcessDampingOptions options;
  options.scatter = request.scatter;
  options.scale_std = std::isnan(request.limit_std) ? limitScaleStd(model, system, cuts) : request.limit_std;
  options.validate();
  ProcessDampingChart chart(system, cuts);
  const ProcessDampingEstimate found = chart.estimate(cuts, options);
  std::printf("process damping: %.4g +- %.2g N/mm\n", found.coefficient / units::N_PER_MM,
              found.std_dev / units::N_PER_MM);
  std::printf("limits of the chart times %.3f (stated: 1 +- %.3f)\n", found.scale, options.scale_std);
  std::printf("%zu cuts, %d of them on the wrong side of the limit by more than three standard deviations\n",
              cuts.size(), found.contradictions);
  if (request.out.empty()) return;
  writeMachineModel(withProcessDamping(readMachineModel(request.model), found), request.out);
}

}  // namespace

namespace smartmill::stability {

Command processDampingCommand() {
  Command command("process-damping",
                  "estimates the coefficient of process damping from cuts at falling speeds");
  command.description =
      "Coefficient of the effect process_damping with its standard deviation, by maximum likelihood over the "
      "stability chart, from cuts whose verdict (stable or chatter) is known. Cut at falling spindle speeds "
      "and, at "
      "each, deepen the cut until it chatters.";
  command.examples = {{"mill.yaml --entry-deg 90 --exit-deg 180 --cuts cuts.csv -o damped.yaml",
                       "the coefficient, and a model with it, for lobes and the stability node"}};
  command.files = {{"CUTS", "CSV rpm,depth_mm,verdict, the verdict stable or chatter"},
                   {"OUT", "machine model file with the effect process_damping"}};
  command.setBody(run, [](CommandLine& line, Request& request) {
    request.addCutTo(line);
    line.option("--cuts", request.cuts, "CSV file rpm,depth_mm,verdict").required();
    line.option(
            "--scatter", request.scatter,
            "relative standard deviation of a limit from cut to cut: speed, depth, a verdict near the limit")
        .showDefault();
    line.option(
        "--limit-std", request.limit_std,
        "relative standard deviation of all limits together (default: from the standard deviations of "
        "the model)");
    line.option("-o,--out", request.out, "machine model with the estimated effect");
  });
  return command;
}

}  // namespace smartmill::stability
