// rosrun smartmill_studies hammer_station: random tools in random machines at the simulated hammer station,
// measured by the hammer sequence and compared with the truth.

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "hammer/station_score.h"
#include "hammer/tap_scatter.h"
#include "hammer/tip_figures.h"
#include "smartmill_core/program.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using nlohmann::json;

struct Options {
  hammer::StationStudy study;
  std::string out = "hammer_station";
  StudyCase one;
  std::string figures;
  int machines = 500, repeats = 0;
};

/// One machine's figures 4.5 to 4.8 of the thesis.
void draw(const hammer::StationFrfs& f, const std::string& folder) {
  if (f.measured.size() == 0) return;
  const studies::TipCurve direct{"direct, at the tip", f.direct};
  const studies::TipCurve measured{"measured, no correction", f.measured}, thesis{"eq. 4.44", f.thesis},
      tip{"receptance coupling", f.tip};
  studies::drawParts({{"true, at the heights of hammer and sensor", f.across}, measured},
                     folder + "/figure_4_5.png");
  studies::drawParts({direct, measured}, folder + "/figure_4_6.png");
  studies::drawParts({direct, measured, thesis, tip}, folder + "/figure_4_7.png");
  studies::drawSlotLimits({direct, measured, thesis, tip}, folder + "/figure_4_8.png");
}

/// Repeated measurements of each machine, or of one.
void repeat(const Options& o) {
  for (int number = o.one.one() ? o.one.number : 0; number < o.machines; ++number) {
    o.one.print(hammer::tapScatter(o.study, number, o.repeats));
    std::fflush(stdout);
    if (o.one.one()) return;
  }
}

void run(const Options& o) {
  if (o.one.scores()) {
    std::printf("%s\n", hammer::scoreStations(readJsonLines(o.one.lines)).dump(1).c_str());
    return;
  }
  o.one.check(o.machines);
  if (o.repeats > 0) return repeat(o);
  if (o.one.one()) {
    hammer::StationFrfs frfs;
    o.one.print(hammer::runStation(o.study, o.one.number, &frfs));
    if (o.figures.empty()) return;
    std::filesystem::create_directories(o.figures);
    draw(frfs, o.figures);
    return;
  }
  std::filesystem::create_directories(o.out);
  const std::string file = o.out + "/stations_" + std::to_string(o.study.seed) + "_" +
                           std::to_string(o.study.hits) + (o.study.opposite ? "_opposite" : "") + ".jsonl";
  std::map<int, json> lines;
  for (const json& line : readJsonLines(file)) lines[line["machine"]] = line;
  std::ofstream table(file, std::ios::app);
  for (int number = 0; number < o.machines; ++number) {
    if (lines.count(number) > 0) continue;
    lines[number] = hammer::runStation(o.study, number);
    table << lines[number].dump() << std::endl;
    std::fprintf(stderr, "%zu of %d machines\n", lines.size(), o.machines);
  }
  std::vector<json> all;
  for (const auto& [number, line] : lines) {
    if (number < o.machines) all.push_back(line);
  }
  std::printf("%s\n", hammer::scoreStations(all).dump(1).c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CommandLine line{
      "Measures random tools in random machines with the automatic hammer and scores the results. One line "
      "of JSON per machine in OUT/stations_SEED_HITS.jsonl; continues an earlier run; prints the "
      "score."};
  o.one.addTo(line, "--machines,--cases", o.machines, "number of machines");
  o.one.addScore(line);
  line.option("--seed", o.study.seed, "seed of all random draws").showDefault();
  line.option("--hits", o.study.hits, "hits per measurement").within(1, 100).showDefault();
  line.flag("--opposite", o.study.opposite,
            "sensor opposite the hammer, even numbers of evenly spaced teeth");
  line.option("--figures", o.figures, "with --case: folder for figures 4.5 to 4.8 of the thesis");
  line.option("--repeats", o.repeats,
              "only repeats each machine N times and compares scatter and stated uncertainty: one line per "
              "machine on standard output")
      .within(3, 1000);
  line.option("-o,--out", o.out, "folder of the lines").showDefault();
  return runProgram(line, argc, argv, [&] { run(o); });
}
