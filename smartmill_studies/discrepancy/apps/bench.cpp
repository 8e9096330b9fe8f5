// rosrun smartmill_studies discrepancy_bench: a machine that shares no physics with the twin hides causes,
// explain looks for them, the seal is opened and the answers are scored.

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "discrepancy/bench_case.h"
#include "discrepancy/bench_score.h"
#include "plant/draw.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/program.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/gap/twin_runner.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using namespace smartmill::discrepancy;
using nlohmann::json;

struct Options {
  std::string out;
  std::vector<std::string> only;
  plant::Counts counts;
  StudyCase one;
  int threads = 2, cases = 0;
  std::uint64_t seed = 1;
  bool keep = false;
};

std::vector<std::string> namesOf(const Options& o) {
  for (const std::string& name : o.only) {
    if (!findEffect(name)) throw UsageError("--only: '" + name + "' is no effect of the catalogue");
  }
  if (!o.only.empty()) return o.only;
  std::vector<std::string> names;
  for (const EffectKind& kind : effectCatalogue()) {
    // The plan of a drawn campaign has moves only where such an effect is hidden, which would give it away.
    if (!kind.has(EffectNeed::axis_motion)) names.push_back(kind.name);
  }
  return names;
}

// What an earlier run of the same bench has left, by case.
std::map<int, json> readLines(const std::string& file) {
  std::map<int, json> lines;
  for (const json& line : readJsonLines(file)) lines[line["case"]] = line;
  return lines;
}

// Without a folder that is named, only the line stays.
void runOne(const Options& o, const plant::Case& hidden) {
  const TemporaryFolder scratch;
  const auto progress = [](const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); };
  const std::string folder =
      (o.out.empty() ? scratch.file("") : o.out + "/") + "case_" + std::to_string(o.one.number);
  const json line = runBenchCase(hidden, o.one.number, folder, progress);
  if (!o.keep && line["right"]) std::filesystem::remove_all(folder);
  o.one.print(line);
}

void run(const Options& o) {
  if (o.one.scores()) return scoreBench(readJsonLines(o.one.lines), o.out.empty() ? "." : o.out);
  std::vector<plant::Case> cases = plant::drawCases(o.counts, namesOf(o), o.seed);
  if (o.cases > static_cast<int>(cases.size()))
    throw UsageError("--cases: " + std::to_string(cases.size()) +
                     " are drawn by --singles, --pairs and so on");
  if (o.cases > 0) cases.resize(static_cast<std::size_t>(o.cases));
  o.one.check(static_cast<int>(cases.size()));
  if (o.one.one()) return runOne(o, cases[static_cast<std::size_t>(o.one.number)]);
  if (o.out.empty()) throw UsageError("--out: a folder of cases and scores is due");
  std::filesystem::create_directories(o.out);
  const std::string file = o.out + "/cases.jsonl";
  std::map<int, json> lines = readLines(file);
  std::ofstream table(file, std::ios::app);
  std::mutex mutex;
  runParallel(cases.size(), o.threads, [&](std::size_t k) {
    const int number = static_cast<int>(k);
    if (lines.count(number) > 0) return;
    const std::string folder = o.out + "/case_" + std::to_string(number);
    const auto progress = [&](const std::string& line) {
      std::ofstream(folder + ".log", std::ios::app) << line << "\n";
    };
    const json line = runBenchCase(cases[k], number, folder, progress);
    if (!o.keep && line["right"]) std::filesystem::remove_all(folder);
    const std::lock_guard<std::mutex> lock(mutex);
    table << line.dump() << std::endl;
    std::printf("%s\n", line.dump().c_str());
    std::fprintf(stderr, "%zu of %zu cases\n", lines.size() + 1, cases.size());
    lines[number] = line;
  });
  std::vector<json> all;
  for (const auto& [number, line] : lines) {
    if (number < static_cast<int>(cases.size())) all.push_back(line);
  }
  scoreBench(all, o.out);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CommandLine line{
      "Blind bench of explain: hides causes in drawn machines, whose physics is another one than the twin's, "
      "and "
      "scores what is named. Goes on where an earlier run into the same folder ended."};
  line.option("-o,--out", o.out, "folder of cases and scores; with --case it may be left out");
  line.option("--singles", o.counts.singles, "cases of each single effect");
  line.option("--pairs", o.counts.pairs, "pairs of effects");
  line.option("--triples", o.counts.triples, "cases of three effects");
  line.option("--none", o.counts.none, "cases with nothing hidden");
  line.option("--outside", o.counts.outside, "cases with a cause outside the catalogue");
  line.option("--only", o.only, "effects to draw from, comma separated").commas();
  line.option("--cases", o.cases, "the first of those drawn (default: all)").notNegative();
  line.option("--case", o.one.number, "only this case of those drawn, its progress on standard error");
  o.one.addScore(line);
  line.option("--seed", o.seed, "of everything drawn");
  line.option("--threads", o.threads, "cases at a time").within(1, 64);
  line.flag("--keep", o.keep, "keep the campaigns of right cases too");
  return runProgram(line, argc, argv, [&] { run(o); });
}
