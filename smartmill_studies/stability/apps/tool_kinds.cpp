// rosrun smartmill_studies stability_tool_kinds MODEL --entry-deg A --exit-deg B --speeds LO:HI
// --max-depth-mm D

#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "stability/study_request.h"
#include "stability/tool_kinds.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  double feed_mm = 0.1;
  int points = 60, revolutions = 400, least = 58;
  std::string only;
};

const char* word(bool chatters) {
  return chatters ? "chatter" : "stable";
}

/// @return whether the target is met.
bool run(const Request& request) {
  const MachineModel model = request.machine();
  stability::ToolKindOptions options{request.range()};
  options.entry_deg = request.entry_deg;
  options.exit_deg = request.exit_deg;
  options.feed = request.feed_mm * units::MM;
  options.points = request.points;
  options.revolutions = request.revolutions;
  CsvWriter csv("tool,rpm,limit_mm,kind,depth_mm,solver,twin", 8);
  bool met = true, found = false;
  for (const stability::ToolKind& kind : stability::toolKinds(*model.tool)) {
    if (!request.only.empty() && kind.name != request.only) continue;
    found = true;
    const auto cuts = stability::cutsAtLimit(model, kind, options, [&](double share) {
      std::fprintf(stderr, "\r%s: %3.0f %% of the cuts", kind.name.c_str(), 100.0 * share);
    });
    std::fprintf(stderr, "\n");
    int right = 0, chatter = 0;
    double least = 1e9, most = 0.0;  // [m]
    for (const stability::CutAtLimit& c : cuts) {
      const double rpm = units::rpmFromRadPerSec(c.speed);
      right += c.right(options.within);
      chatter += c.observed;
      least = std::min(least, c.limit);
      most = std::max(most, c.limit);
      csv.row(kind.name, rpm, c.limit / units::MM, nameOf(c.kind), c.depth / units::MM, word(c.chatters),
              word(c.observed));
      if (!c.right(options.within))
        std::printf("  %.1f rpm, limit %.4f mm, depth %.4f mm (%.1f %%): solver %s, twin %s\n", rpm,
                    c.limit / units::MM, c.depth / units::MM, 100.0 * (c.depth / c.limit - 1.0),
                    word(c.chatters), word(c.observed));
    }
    std::printf(
        "%s: %d of %zu on the right side or within %.3g %% of the limit; %d chatter, limits %.2f..%.2f mm\n",
        kind.name.c_str(), right, cuts.size(), 100.0 * options.within, chatter, least / units::MM,
        most / units::MM);
    met = met && right >= request.least;
  }
  if (!found) throw Error("--only " + request.only + ": expected the name of a kind of tool");
  if (!request.out.empty()) csv.save(request.out);
  return met;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Compares charts of tools with edges of different shapes with the time-domain simulator: cuts about "
      "the "
      "limit, at random speeds. Exit code 0: each kind reaches --least, else 3."};
  request.addTo(line);
  line.option("--points", request.points, "cuts of each kind (60)").within(1, 100000);
  line.option("--least", request.least, "required number of right cuts of each kind (58)");
  line.option("--only", request.only, "only this kind of tool, for example 'ball'");
  line.option("--feed-mm", request.feed_mm, "per tooth [mm] (0.1)");
  line.option("--revolutions", request.revolutions, "of a cut (400)");
  line.option("-o,--out", request.out, "CSV of all cuts");
  return runProgram(line, argc, argv, [&] { return run(request) ? 0 : 3; });
}
