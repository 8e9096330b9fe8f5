// rosrun smartmill_studies stability_control MODEL --entry-deg A --exit-deg B --speeds LO:HI --max-depth-mm D

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "stability/control_study.h"
#include "stability/study_request.h"
#include "study_case.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  int cuts = 100;
  double frequency = 2.0, gain = 5.0, reaction = 0.2;
  StudyCase one;
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

void print(const std::vector<stability::ControlCut>& cuts) {
  std::vector<double> after_onset, after_request, thinking;
  double removal = 0.0, careful = 0.0, ended_removal = 0.0, ended_careful = 0.0;
  int requested = 0, once = 0, floor = 0, said = 0, next = 0;
  for (const stability::ControlCut& cut : cuts) {
    removal += cut.removal / static_cast<double>(cuts.size());
    careful += cut.careful / static_cast<double>(cuts.size());
    requested += cut.moves > 0;
    if (cut.moves > 0) thinking.push_back(cut.thinking / cut.moves);
    floor += !cut.end();
    said += !cut.end() && cut.next_speed > 0.0;
    next += !cut.end() && cut.next_stable;
    if (!cut.end()) continue;
    once += cut.moves == 1;
    ended_removal += cut.removal;
    ended_careful += cut.careful;
    after_onset.push_back(cut.ended - cut.onset);
    after_request.push_back(cut.ended - cut.requested);
  }
  const auto ended = static_cast<double>(after_onset.size());
  std::printf(
      "%zu cuts that chatter: overrides requested in %d, chatter ended in %.0f (%d by one change), not ended "
      "%d; of these a next cut was recommended for %d, stable in %d\n",
      cuts.size(), requested, ended, once, floor, said, next);
  std::printf(
      "revolutions from the onset to the end: median %.0f, 95 %% %.0f; from the first request: median %.0f, "
      "95 %% %.0f\n",
      quantile(after_onset, 0.5), quantile(after_onset, 0.95), quantile(after_request, 0.5),
      quantile(after_request, 0.95));
  std::printf(
      "removal rate over the programmed one, all cuts: %.3f, an operator who halves the depth: %.3f (times "
      "%.2f); where ended: %.3f against %.3f\n",
      removal, careful, removal / careful, ended_removal / ended, ended_careful / ended);
  std::printf("computing time of an advice: median %.2f s, longest %.2f s\n", quantile(thinking, 0.5),
              quantile(thinking, 1.0));
}

void save(const std::vector<stability::ControlCut>& cuts, const std::string& file) {
  CsvWriter csv(
      "rpm,depth_mm,limit_mm,onset_rev,asked_rev,ended_rev,moves,spindle,feed,removal,careful,next_rpm,next_"
      "mm,next_stable,said",
      7);
  for (const stability::ControlCut& c : cuts)
    csv.row(units::rpmFromRadPerSec(c.speed), c.depth / units::MM, c.limit / units::MM, c.onset, c.requested,
            c.ended, c.moves, c.spindle, c.feed, c.removal, c.careful, units::rpmFromRadPerSec(c.next_speed),
            c.next_depth / units::MM, static_cast<int>(c.next_stable), c.reason);
  csv.save(file);
}

nlohmann::json lineOf(int number, const stability::ControlCut& c) {
  return {{"case", number},
          {"speed_rpm", units::rpmFromRadPerSec(c.speed)},
          {"depth_mm", c.depth / units::MM},
          {"limit_mm", c.limit / units::MM},
          {"onset_rev", c.onset},
          {"asked_rev", c.requested},
          {"ended_rev", c.ended},
          {"ended", c.end()},
          {"moves", c.moves},
          {"spindle", c.spindle},
          {"feed", c.feed},
          {"removal", c.removal},
          {"careful", c.careful},
          {"next_rpm", units::rpmFromRadPerSec(c.next_speed)},
          {"next_mm", c.next_depth / units::MM},
          {"next_stable", c.next_stable},
          {"said", c.reason},
          {"thinking", c.thinking}};
}

stability::ControlCut cutOf(const nlohmann::json& line) {
  stability::ControlCut c;
  c.speed = units::radPerSecFromRpm(line.at("speed_rpm"));
  c.depth = line.at("depth_mm").get<double>() * units::MM;
  c.limit = line.at("limit_mm").get<double>() * units::MM;
  c.onset = line.at("onset_rev");
  c.requested = numberOf(line, "asked_rev");
  c.ended = numberOf(line, "ended_rev");
  c.moves = line.at("moves");
  c.spindle = line.at("spindle");
  c.feed = line.at("feed");
  c.removal = line.at("removal");
  c.careful = line.at("careful");
  c.next_speed = units::radPerSecFromRpm(line.at("next_rpm"));
  c.next_depth = line.at("next_mm").get<double>() * units::MM;
  c.next_stable = line.at("next_stable");
  c.reason = line.at("said");
  c.thinking = line.at("thinking");
  return c;
}

void report(const Request& request, const std::vector<stability::ControlCut>& cuts) {
  print(cuts);
  if (!request.out.empty()) save(cuts, request.out);
}

void run(const Request& request) {
  request.one.check(request.cuts);
  if (request.one.scores()) {
    std::vector<stability::ControlCut> cuts;
    for (const nlohmann::json& line : readJsonLines(request.one.lines)) cuts.push_back(cutOf(line));
    return report(request, cuts);
  }
  MachineModel model = request.machine();
  model.uncertainty.frequency = request.frequency;
  model.uncertainty.damping = model.uncertainty.stiffness = model.uncertainty.cutting = request.gain;
  stability::ControlOptions options{request.range()};
  options.cuts = request.cuts;
  options.reaction = request.reaction;
  options.control.adaptive = true;
  if (request.one.one()) {
    options.cuts = 1;
    options.seed = static_cast<unsigned>(seedOfCase(options.seed, request.one.number));
    const auto cut = controlStudy(model, request.system(model), options).front();
    return request.one.print(lineOf(request.one.number, cut));
  }
  const auto cuts = controlStudy(model, request.system(model), options,
                                 [](double share) { std::fprintf(stderr, "\r%3.0f %%", 100.0 * share); });
  std::fprintf(stderr, "\n");
  report(request, cuts);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Chatter control of simulated cuts on machines that differ from their model: overrides of spindle and "
      "feed that end the chatter, compared with an operator who halves the depth."};
  request.addTo(line);
  request.one.addTo(line, "--cuts,--cases", request.cuts, "number of cuts");
  request.one.addScore(line);
  line.option("--frequency-percent", request.frequency, "standard deviation of the modes' frequencies (2)");
  line.option("--gain-percent", request.gain, "of damping, compliance and coefficients (5)");
  line.option("--reaction", request.reaction, "from an advice to the controller's new overrides [s] (0.2)");
  line.option("-o,--out", request.out, "CSV of all cuts");
  return runProgram(line, argc, argv, [&] { run(request); });
}
