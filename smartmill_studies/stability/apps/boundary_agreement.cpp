// rosrun smartmill_studies stability_boundary_agreement MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "stability/boundary_agreement.h"
#include "stability/study_request.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  double side_percent = 3.0, feed_mm = 0.1, amplitude = 0.0, ratio = 0.1;
  int points = 60, revolutions = 400, least = 58;
};

/// @return whether the target is met.
bool run(const Request& request) {
  const MachineModel model = request.machine();
  stability::BoundaryOptions options{request.range()};
  options.entry_deg = request.entry_deg;
  options.exit_deg = request.exit_deg;
  options.side = 0.01 * request.side_percent;
  options.feed = request.feed_mm * units::MM;
  options.points = request.points;
  options.revolutions = request.revolutions;
  if (request.amplitude > 0.0) options.variation = SpeedVariation{request.amplitude, request.ratio};
  const auto points = stability::agreementAtBoundary(
      model, options, [](double share) { std::fprintf(stderr, "\r%3.0f %% of the cuts", 100.0 * share); });
  std::fprintf(stderr, "\n");
  const auto word = [](bool chatters) { return chatters ? "chatter" : "stable"; };
  std::string table = "rpm,position_mm,limit_mm,chatter_hz,kind,below,above\n";
  int agree = 0;
  std::printf("%10s %12s %10s %11s %6s %8s %8s\n", "rpm", "position_mm", "limit_mm", "chatter_hz", "kind",
              "below", "above");
  for (const stability::SidedLimit& p : points) {
    agree += p.agrees();
    const double rpm = units::rpmFromRadPerSec(p.speed);
    char line[200];
    std::snprintf(line, sizeof line, "%.8g,%.8g,%.8g,%.8g,%s,%s,%s\n", rpm, p.position / units::MM,
                  p.limit.depth / units::MM, p.limit.frequency, nameOf(p.limit.kind), word(p.below_chatters),
                  word(p.above_chatters));
    table += line;
    if (!p.agrees())
      std::printf("%10.1f %12.3f %10.4f %11.2f %6s %8s %8s\n", rpm, p.position / units::MM,
                  p.limit.depth / units::MM, p.limit.frequency, nameOf(p.limit.kind), word(p.below_chatters),
                  word(p.above_chatters));
  }
  std::printf("%d of %zu limits agree within %.3g %%; those that differ are listed above\n", agree,
              points.size(), request.side_percent);
  if (!request.out.empty()) {
    std::ofstream csv(request.out);
    csv << table;
    csv.close();
    if (!csv) throw Error(request.out + ": cannot be written");
  }
  return agree >= request.least;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Compares limits of the depth with the time-domain simulator: cuts below the limit must be stable, "
      "cuts "
      "above it chatter. Speeds, and positions along a workpiece with several places, are drawn. Exit code "
      "0: "
      "agreement reaches --least, else 3."};
  request.addTo(line);
  line.option("--points", request.points, "limits (60)").within(1, 100000);
  line.option("--side", request.side_percent, "distance of the cuts from the limit [% of the depth] (3)");
  line.option("--least", request.least, "required number of points that agree (58)");
  line.option("--variation", request.amplitude, "amplitude of a sinusoidal speed variation [1] (0)");
  line.option("--ratio", request.ratio, "frequency of the variation over that of the spindle [1] (0.1)");
  line.option("--feed-mm", request.feed_mm, "per tooth [mm] (0.1)");
  line.option("--revolutions", request.revolutions, "of a cut, at least (400)");
  line.option("-o,--out", request.out, "CSV of all points");
  return runProgram(line, argc, argv, [&] { return run(request) ? 0 : 3; });
}
