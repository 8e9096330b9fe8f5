// rosrun smartmill_studies stability_surface_error MODEL

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/surface_error.h"
#include "smartmill_stability/solvers/model_system.h"
#include "stability/twin_cuts.h"

namespace {

using namespace smartmill;
using stability::ChipGeometry;
using stability::RegenerativeSystem;
using stability::TwinCut;
using stability::WallPrediction;

struct Request {
  std::string model, out;
  int points = 20;
  unsigned seed = 1;
  double runout_um = 0.0;
};

constexpr int SAMPLES = 720;       // per revolution, a multiple of the teeth drawn
constexpr int REVOLUTIONS = 150;   // in which the transient decays
constexpr double BETWEEN = 0.137;  // [1] of a sample: phase of the simulator (twin_cuts.cpp)

/// A drawn finishing cut.
struct Point {
  MachineModel model;
  RegenerativeSystem system;
  double speed = 0.0, depth = 0.0;  // [rad/s], [m]
  bool down = false;
  double predicted = 0.0, observed = 0.0, largest = 0.0;  // [m] of the first tooth; largest |u| in the twin
  double size() const { return std::max(std::abs(predicted), std::abs(observed)); }
};

/// Radial immersion 2 .. 20 %, up or down, helix 0, 30 or 45 deg, 1 .. 4 teeth, feed 0.03 .. 0.12 mm, 20 ..
/// 70 % of the limit or of 6 mm.
std::vector<Point> draw(const Request& request) {
  const MachineModel nominal = readMachineModel(request.model);
  std::mt19937_64 random(request.seed);
  std::uniform_real_distribution<double> unit;
  std::vector<Point> points;
  while (static_cast<int>(points.size()) < request.points) {
    Point p;
    p.model = nominal;
    ToolGeometry& tool = *p.model.tool;
    tool.teeth = 1 + static_cast<int>(4.0 * unit(random));
    tool.helix =
        units::radFromDeg(std::vector<double>{0.0, 30.0, 45.0}[static_cast<std::size_t>(3.0 * unit(random))]);
    tool.pitch.clear();
    p.down = unit(random) < 0.5;
    const double arc = std::acos(1.0 - 2.0 * (0.02 + 0.18 * unit(random)));
    const double feed = (0.03 + 0.09 * unit(random)) * units::MM;
    p.speed = units::radPerSecFromRpm(4000.0 + 14000.0 * unit(random));
    p.model.effects.clear();
    if (request.runout_um > 0.0) {
      EffectEntry runout;
      runout.name = "runout";
      runout.numbers = {{"offset_um", request.runout_um}, {"angle_deg", 360.0 * unit(random)}};
      p.model.effects.push_back(runout);
    }
    p.system = stability::systemOf(p.model, units::degFromRad(p.down ? units::PI - arc : 0.0),
                                   units::degFromRad(p.down ? units::PI : arc));
    const double limit = makeSolver(stability::Method::collocation, p.system)->limit(p.speed, 6e-3).depth;
    p.depth = std::min(limit, 6e-3) * (0.2 + 0.5 * unit(random));
    p.system.chip = stability::finishingChip(p.model, feed);
    p.predicted = WallPrediction(p.system).offsets(p.speed, p.depth, {0.0})[0][0];
    points.push_back(p);
  }
  return points;
}

/// [m] Offset that the first tooth leaves at the tip in the last whole revolution of a record.
double observed(const Point& p, const Record& record) {
  const std::vector<double>& y = record.column("tool_y");
  // The first tooth passes angle 0 of the record `BETWEEN` samples before the first one.
  const double at = (REVOLUTIONS - 2) * SAMPLES + (p.down ? 0.5 * SAMPLES : 0.0) - BETWEEN;
  const auto i = static_cast<std::size_t>(std::floor(at));
  const double share = at - std::floor(at);
  const double u = (1.0 - share) * y[i] + share * y[i + 1];
  const double own = p.system.chip->radius_offset.empty() ? 0.0 : p.system.chip->radius_offset[0];
  return own + (p.down ? -u : u);
}

void run(const Request& request) {
  std::vector<Point> points = draw(request);
  std::vector<MachineModel> models;
  std::vector<TwinCut> cuts;
  for (const Point& p : points) {
    models.push_back(p.model);
    cuts.push_back(
        {p.speed, {p.system.entry, p.system.exit, p.depth, p.system.chip->feed}, SAMPLES, REVOLUTIONS, 0});
  }
  stability::runTwinCuts(models, cuts, {{"tool_x", "tool_y"}}, [&](std::size_t i, const Record& record) {
    points[i].observed = observed(points[i], record);
    const std::vector<double>& y = record.column("tool_y");
    for (std::size_t k = y.size() / 2; k < y.size(); ++k)
      points[i].largest = std::max(points[i].largest, std::abs(y[k]));
  });
  CsvWriter csv("rpm,depth_mm,teeth,helix_deg,arc_deg,down,feed_mm,predicted_um,twin_um,vibration_um", 6);
  std::vector<double> off;  // [1] of the vibration
  double largest = 0.0;     // [um]
  for (const Point& p : points) {
    csv.row(units::rpmFromRadPerSec(p.speed), p.depth / units::MM, p.model.tool->teeth,
            units::degFromRad(p.model.tool->helix), units::degFromRad(p.system.exit - p.system.entry),
            static_cast<int>(p.down), p.system.chip->feed / units::MM, p.predicted / units::UM,
            p.observed / units::UM, p.largest / units::UM);
    off.push_back(std::abs(p.predicted - p.observed) / p.largest);
    largest = std::max(largest, std::abs(p.predicted - p.observed) / units::UM);
  }
  std::printf("%s", csv.text().c_str());
  if (!request.out.empty()) csv.save(request.out);
  std::sort(off.begin(), off.end());
  std::printf(
      "difference from the twin: median %.2f %%, largest %.2f %% of the vibration, largest %.3f um, %d "
      "cuts\n",
      100.0 * off[off.size() / 2], 100.0 * off.back(), largest, request.points);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Compares the predicted surface location error with the time-domain simulator at drawn cuts."};
  line.option("MODEL", request.model, "machine model file with sections tool, cutting and tool_tip")
      .required();
  line.option("--points", request.points, "number of cuts (20)");
  line.option("--seed", request.seed, "of the draws (1)");
  line.option("--runout-um", request.runout_um, "offset of the tool's axis [um] (0)");
  line.option("-o,--out", request.out, "CSV of all cuts");
  return runProgram(line, argc, argv, [&] {
    run(request);
    return 0;
  });
}
