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
#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/program.h"
#include "smartmill_discrepancy/gap/twin_runner.h"

namespace {

using namespace smartmill;
using namespace smartmill::discrepancy;
using nlohmann::json;

struct Options {
  std::string out;
  std::vector<std::string> only;
  plant::Counts counts;
  int threads = 2, only_case = -1;
  std::uint64_t seed = 1;
  bool keep = false;
};

std::vector<std::string> namesOf(const Options& o) {
  for (const std::string& name : o.only) {
    if (!findEffect(name)) throw UsageError("--only: '" + name + "' is no effect of the catalogue");
  }
  if (!o.only.empty()) return o.only;
  std::vector<std::string> names;
  for (const EffectKind& kind : effectCatalogue()) names.push_back(kind.name);
  return names;
}

// What an earlier run of the same bench has left, by case.
std::map<int, json> readLines(const std::string& file) {
  std::map<int, json> lines;
  std::ifstream in(file);
  for (std::string text; std::getline(in, text);) {
    const json line = json::parse(text, nullptr, false);
    if (!line.is_discarded()) lines[line["case"]] = line;  // a line cut off by an end is done again
  }
  return lines;
}

void run(const Options& o) {
  const std::vector<plant::Case> cases = plant::drawCases(o.counts, namesOf(o), o.seed);
  std::filesystem::create_directories(o.out);
  const std::string file = o.out + "/cases.jsonl";
  std::map<int, json> lines = readLines(file);
  std::ofstream table(file, std::ios::app);
  std::mutex mutex;
  runParallel(cases.size(), o.threads, [&](std::size_t k) {
    const int number = static_cast<int>(k);
    if (o.only_case >= 0 ? number != o.only_case : lines.count(number) > 0) return;
    const std::string folder = o.out + "/case_" + std::to_string(number);
    const auto progress = [&](const std::string& line) {
      std::ofstream(folder + ".log", std::ios::app) << line << "\n";
      if (o.only_case >= 0) std::fprintf(stderr, "%s\n", line.c_str());
    };
    const json line = runBenchCase(cases[k], number, folder, progress);
    if (!o.keep && line["right"]) std::filesystem::remove_all(folder);
    const std::lock_guard<std::mutex> lock(mutex);
    table << line.dump() << std::endl;
    std::printf("%s\n", line.dump().c_str());
    std::fprintf(stderr, "%zu of %zu cases\n", lines.size() + 1, cases.size());
    lines[number] = line;
  });
  if (o.only_case >= 0) return;
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
  line.option("-o,--out", o.out, "folder of cases and scores").required();
  line.option("--singles", o.counts.singles, "cases of each single effect");
  line.option("--pairs", o.counts.pairs, "pairs of effects");
  line.option("--triples", o.counts.triples, "cases of three effects");
  line.option("--none", o.counts.none, "cases with nothing hidden");
  line.option("--outside", o.counts.outside, "cases with a cause outside the catalogue");
  line.option("--only", o.only, "effects to draw from, comma separated").commas();
  line.option("--case", o.only_case, "only this case of those drawn, with its progress");
  line.option("--seed", o.seed, "of everything drawn");
  line.option("--threads", o.threads, "cases at a time").within(1, 64);
  line.flag("--keep", o.keep, "keep the campaigns of right cases too");
  return runProgram(line, argc, argv, [&] { run(o); });
}
