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
#include "stability/study_request.h"
#include "stability/twin_agreement.h"
#include "study_case.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  double band_percent = 5.0, least_percent = 98.0;
  double helix_deg = -1.0, feed_mm = 0.1;
  std::vector<double> pitch_deg;
  int points = 400, revolutions = 180;
  bool linear = false;
  StudyCase one;
};

nlohmann::json lineOf(int number, const stability::AgreementPoint& p) {
  return {{"case", number},
          {"speed_rpm", units::rpmFromRadPerSec(p.speed)},
          {"depth_mm", p.depth / units::MM},
          {"limit_mm", p.limit / units::MM},
          {"multiplier", p.radius},
          {"seen", p.observed_chatter},
          {"agrees", p.agrees()}};
}

stability::AgreementPoint pointOf(const nlohmann::json& line) {
  stability::AgreementPoint p;
  p.speed = units::radPerSecFromRpm(line.at("speed_rpm"));
  p.depth = line.at("depth_mm").get<double>() * units::MM;
  p.limit = numberOf(line, "limit_mm") * units::MM;
  p.radius = line.at("multiplier");
  p.observed_chatter = line.at("seen");
  return p;
}

/// @return whether the target is met.
bool report(const Request& request, const std::vector<stability::AgreementPoint>& points) {
  std::printf("%10s %10s %10s %11s %10s %10s\n", "rpm", "depth_mm", "limit_mm", "multiplier", "solver",
              "twin");
  const auto word = [](bool chatters) { return chatters ? "chatter" : "stable"; };
  int agree = 0, chatter = 0;
  for (const stability::AgreementPoint& p : points) {
    agree += p.agrees();
    chatter += p.chatters();
    if (!p.agrees())
      std::printf("%10.1f %10.4f %10.4f %11.4f %10s %10s\n", units::rpmFromRadPerSec(p.speed),
                  p.depth / units::MM, p.limit / units::MM, p.radius, word(p.chatters()),
                  word(p.observed_chatter));
  }
  const double share = 100.0 * agree / static_cast<double>(points.size());
  std::printf("%d of %zu points agree (%.2f %%), %d of them chatter; those that differ are listed above\n",
              agree, points.size(), share, chatter);
  if (!request.out.empty()) {
    std::ofstream csv(request.out);
    csv.precision(8);
    csv << "rpm,depth_mm,limit_mm,multiplier,solver,twin\n";
    for (const stability::AgreementPoint& p : points)
      csv << units::rpmFromRadPerSec(p.speed) << ',' << p.depth / units::MM << ',' << p.limit / units::MM
          << ',' << p.radius << ',' << word(p.chatters()) << ',' << word(p.observed_chatter) << '\n';
    csv.close();
    if (!csv) throw Error(request.out + ": cannot be written");
  }
  return share >= request.least_percent;
}

/// @return whether the target is met.
bool run(const Request& request) {
  MachineModel model = request.machine();
  if (request.helix_deg >= 0.0) model.tool->helix = units::radFromDeg(request.helix_deg);
  if (!request.pitch_deg.empty()) {
    model.tool->pitch.clear();
    for (const double p : request.pitch_deg) model.tool->pitch.push_back(units::radFromDeg(p));
  }
  stability::AgreementOptions options{request.range()};
  options.band = 0.01 * request.band_percent;
  options.feed = request.feed_mm * units::MM;
  options.points = request.points;
  options.revolutions = request.revolutions;
  stability::RegenerativeSystem system = request.system(model);
  if (!system.evenPitch() && !request.linear) {
    system.chip.emplace();
    system.chip->feed = options.feed;
  }
  request.one.check(request.points);
  if (request.one.scores()) {
    std::vector<stability::AgreementPoint> points;
    for (const nlohmann::json& line : readJsonLines(request.one.lines)) points.push_back(pointOf(line));
    return report(request, points);
  }
  if (request.one.one()) {
    options.points = 1;
    options.seed = static_cast<unsigned>(seedOfCase(options.seed, request.one.number));
    request.one.print(lineOf(request.one.number, agreementWithTwin(model, system, options).front()));
    return true;
  }
  const auto points = agreementWithTwin(model, system, options, [](double share) {
    std::fprintf(stderr, "\r%3.0f %% of the cuts", 100.0 * share);
  });
  std::fprintf(stderr, "\n");
  return report(request, points);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Compares the solver with the time-domain simulator at random speeds and depths outside a band around "
      "the boundary. Exit code 0: agreement reaches --least, else 3."};
  request.addTo(line);
  request.one.addTo(line, "--points,--cases", request.points, "number of points");
  request.one.addScore(line);
  line.option("--band", request.band_percent,
              "width of the excluded band around the boundary [% of the depth] (5)");
  line.option("--least", request.least_percent, "required agreement [%] (98)");
  line.option("--helix-deg", request.helix_deg, "instead of the model's [deg]");
  line.option("--pitch-deg", request.pitch_deg, "instead of the model's, one per tooth [deg]").commas();
  line.flag("--linear-chips", request.linear,
            "uneven pitch: the solver assumes that every tooth cuts along its complete arc (linear theory)");
  line.option("--feed-mm", request.feed_mm, "per tooth [mm] (0.1)");
  line.option("--revolutions", request.revolutions, "of a cut (180)");
  line.option("-o,--out", request.out, "CSV of all points");
  return runProgram(line, argc, argv, [&] { return run(request) ? 0 : 3; });
}
