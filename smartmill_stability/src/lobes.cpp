// rosrun smartmill_stability lobes MODEL --entry-deg A --exit-deg B --speeds LO:HI:N --max-depth-mm D -o
// chart.csv

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "picture.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/zero_order.h"

namespace {

using namespace smartmill;

struct Request {
  std::string model, method = "zero_order", speeds, out;
  double entry_deg = 0.0, exit_deg = 180.0, max_depth_mm = 0.0;
};

std::vector<double> speedsOf(const std::string& text) {
  double low = 0.0, high = 0.0;
  int count = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%lf:%lf:%d%c", &low, &high, &count, &rest) != 3 || !(low > 0.0) ||
      !(high >= low) || count < 1 || (count > 1 && high == low)) {
    throw Error("--speeds " + text + ": LO:HI:N in rpm is due, 0 < LO < HI, N >= 1");
  }
  std::vector<double> speeds;
  for (int i = 0; i < count; ++i) {
    speeds.push_back(units::radPerSecFromRpm(count == 1 ? low : low + (high - low) * i / (count - 1)));
  }
  return speeds;
}

void draw(const std::string& csv, double max_depth_mm) {
  stability::drawBeside(
      csv, "set xlabel 'Spindle speed [rpm]'\nset ylabel 'Axial depth [mm]'\nset yrange [0:" +
               std::to_string(max_depth_mm) +
               "]\nplot %FILE skip 1 using 1:2 with lines lw 2 title 'zero-order stability limit'");
}

void run(const Request& request) {
  if (request.method != "zero_order") throw Error("--method " + request.method + ": zero_order is due");
  if (!(request.max_depth_mm > 0.0)) throw Error("--max-depth-mm: above 0 is due");
  const std::vector<double> speeds = speedsOf(request.speeds);
  const MachineModel model = readMachineModel(request.model);
  const ToolGeometry& tool = model.needTool("predict stability");
  const CuttingCoefficients& cutting = model.needCutting("predict stability");
  double highest = 0.0;
  for (const ModalModel* axis : {&model.tool_tip.x, &model.tool_tip.y}) {
    for (const Mode& mode : axis->modes) highest = std::max(highest, mode.frequency);
  }
  if (highest == 0.0) throw Error(request.model + ": tool_tip is missing (needed to predict stability)");
  stability::RegenerativeProcess process;
  process.teeth = tool.teeth;
  process.entry = units::radFromDeg(request.entry_deg);
  process.exit = units::radFromDeg(request.exit_deg);
  process.kt = cutting.ktc;
  process.kr = cutting.krc / cutting.ktc;
  constexpr std::size_t LINES = 40000;
  // Beyond three times the highest mode the receptance is a small, real, negative mass line.
  const auto response = stability::responseOf(model.tool_tip.x, model.tool_tip.y, 1.0, 3.0 * highest, LINES);
  const stability::StabilityLimit limit = stability::zeroOrderLimit(process, response, speeds);

  std::ofstream csv(request.out);
  csv.precision(8);
  csv << "rpm,limit_mm,chatter_hz,kind\n";
  for (std::size_t i = 0; i < speeds.size(); ++i) {
    csv << units::rpmFromRadPerSec(speeds[i]) << ',';
    if (limit.depth[i] / units::MM <= request.max_depth_mm) {
      csv << limit.depth[i] / units::MM << ',' << limit.chatter_frequency[i] << ",hopf\n";
    } else {
      csv << ",,\n";
    }
  }
  csv.close();
  if (!csv) throw Error(request.out + ": cannot be written");
  draw(request.out, request.max_depth_mm);
  const double absolute = stability::absoluteDepthLimit(process, response);
  if (std::isfinite(absolute)) {
    std::printf("stable at every speed below %.4f mm (zero-order)\n", absolute / units::MM);
  } else {
    std::printf("stable at every depth (zero-order)\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CLI::App app{"Stability lobes of a machine model: the first loss of stability over spindle speed."};
  app.add_option("model", request.model, "machine model file with tool, cutting and tool_tip")->required();
  app.add_option("--entry-deg", request.entry_deg, "immersion angle at which a tooth enters [deg]")
      ->required();
  app.add_option("--exit-deg", request.exit_deg, "immersion angle at which a tooth leaves [deg]")->required();
  app.add_option("--method", request.method, "solver: zero_order");
  app.add_option("--speeds", request.speeds, "LO:HI:N [rpm]")->required();
  app.add_option("--max-depth-mm", request.max_depth_mm, "depths up to here [mm]")->required();
  app.add_option("-o,--out", request.out, "CSV file; a picture of the same name with .png stands beside it")
      ->required();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  try {
    run(request);
  } catch (const std::exception& e) {
    std::cerr << "lobes: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
