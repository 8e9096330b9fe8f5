// rosrun smartmill_studies stability_twin_agreement MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"
#include "stability/twin_agreement.h"

namespace {

using namespace smartmill;

struct Request {
  std::string model, speeds, out;
  double entry_deg = 0.0, exit_deg = 180.0, max_depth_mm = 0.0, band_percent = 5.0, least_percent = 98.0;
  double helix_deg = -1.0, feed_mm = 0.1;
  std::vector<double> pitch_deg;
  int points = 400, revolutions = 180;
  unsigned seed = 1;
  bool linear = false;
};

/// @return whether the target is met.
bool run(const Request& request) {
  MachineModel model = readMachineModel(request.model);
  model.needTool("simulate cuts");
  if (request.helix_deg >= 0.0) model.tool->helix = units::radFromDeg(request.helix_deg);
  if (!request.pitch_deg.empty()) {
    model.tool->pitch.clear();
    for (const double p : request.pitch_deg) model.tool->pitch.push_back(units::radFromDeg(p));
  }
  stability::AgreementOptions options;
  double low = 0.0, high = 0.0;
  char rest = 0;
  if (std::sscanf(request.speeds.c_str(), "%lf:%lf%c", &low, &high, &rest) != 2)
    throw Error("--speeds " + request.speeds + ": LO:HI is due");
  options.speed_low = units::radPerSecFromRpm(low);
  options.speed_high = units::radPerSecFromRpm(high);
  options.max_depth = request.max_depth_mm * units::MM;
  options.band = 0.01 * request.band_percent;
  options.feed = request.feed_mm * units::MM;
  options.points = request.points;
  options.seed = request.seed;
  options.revolutions = request.revolutions;
  stability::RegenerativeSystem system = stability::systemOf(model, request.entry_deg, request.exit_deg);
  if (!system.evenPitch() && !request.linear) {
    system.chip.emplace();
    system.chip->feed = options.feed;
  }
  const auto points = agreementWithTwin(model, system, options, [](double share) {
    std::fprintf(stderr, "\r%3.0f %% of the cuts", 100.0 * share);
  });
  std::fprintf(stderr, "\n");
  std::printf("%10s %10s %10s %11s %10s %10s\n", "rpm", "depth_mm", "limit_mm", "multiplier", "solver",
              "twin");
  const auto word = [](bool chatters) { return chatters ? "chatter" : "stable"; };
  int agree = 0, chatter = 0;
  for (const stability::AgreementPoint& p : points) {
    agree += p.agrees();
    chatter += p.chatters();
    if (!p.agrees())
      std::printf("%10.1f %10.4f %10.4f %11.4f %10s %10s\n", units::rpmFromRadPerSec(p.speed),
                  p.depth / units::MM, p.limit / units::MM, p.radius, word(p.chatters()), word(p.seen));
  }
  const double share = 100.0 * agree / static_cast<double>(points.size());
  std::printf("%d of %zu points agree (%.2f %%), %d of them chatter; those that differ stand above\n", agree,
              points.size(), share, chatter);
  if (!request.out.empty()) {
    std::ofstream csv(request.out);
    csv.precision(8);
    csv << "rpm,depth_mm,limit_mm,multiplier,solver,twin\n";
    for (const stability::AgreementPoint& p : points)
      csv << units::rpmFromRadPerSec(p.speed) << ',' << p.depth / units::MM << ',' << p.limit / units::MM
          << ',' << p.radius << ',' << word(p.chatters()) << ',' << word(p.seen) << '\n';
    csv.close();
    if (!csv) throw Error(request.out + ": cannot be written");
  }
  return share >= request.least_percent;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Compares the solver with the simulator in time at random speeds and depths outside a band around the "
      "boundary. Exit code 0: they agree often enough, 3: they do not."};
  line.option("model", request.model, "machine model file with tool, cutting and tool_tip").required();
  line.option("--entry-deg", request.entry_deg, "immersion angle at which a tooth enters [deg]").required();
  line.option("--exit-deg", request.exit_deg, "immersion angle at which a tooth leaves [deg]").required();
  line.option("--speeds", request.speeds, "LO:HI [rpm]").required();
  line.option("--max-depth-mm", request.max_depth_mm, "limits are looked for up to here [mm]").required();
  line.option("--points", request.points, "how many (400)");
  line.option("--seed", request.seed, "of the points (1)");
  line.option("--band", request.band_percent, "around the boundary, without points [% of the depth] (5)");
  line.option("--least", request.least_percent, "agreement due [%] (98)");
  line.option("--helix-deg", request.helix_deg, "instead of the model's [deg]");
  line.option("--pitch-deg", request.pitch_deg, "instead of the model's, one a tooth [deg]").commas();
  line.flag("--linear-chips", request.linear,
            "uneven pitch: the solver takes every tooth to cut all along its arc, as linear theory has it");
  line.option("--feed-mm", request.feed_mm, "per tooth [mm] (0.1)");
  line.option("--revolutions", request.revolutions, "of a cut (180)");
  line.option("-o,--out", request.out, "CSV of all points");
  return runProgram(line, argc, argv, [&] { return run(request) ? 0 : 3; });
}
