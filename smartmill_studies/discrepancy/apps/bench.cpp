// rosrun smartmill_studies discrepancy_bench: hides causes in a machine that shares no physics with the twin,
// runs explain and scores its answers against the hidden truth.

#include <algorithm>
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
  std::vector<std::string> only, outside_kinds = plant::outsideKinds();
  plant::Counts counts;
  StudyCase one;
  int threads = 2, cases = 0, misstated = 0;
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
    // Only campaigns with a hidden motion effect contain moves, which would reveal it.
    if (!kind.has(EffectNeed::axis_motion)) names.push_back(kind.name);
  }
  return names;
}

void checkOutsideKinds(const std::vector<std::string>& kinds) {
  const auto contains = [](const std::vector<std::string>& known, const std::string& kind) {
    return std::find(known.begin(), known.end(), kind) != known.end();
  };
  for (const std::string& kind : kinds) {
    if (!contains(plant::outsideKinds(), kind) && !contains(plant::requestedOutsideKinds(), kind))
      throw UsageError("--outside-kinds: '" + kind + "' is no kind of outside cause");
  }
  if (kinds.empty()) throw UsageError("--outside-kinds: expected at least one kind");
}

// [1] Errors of misstated nominal values over their stated uncertainty.
constexpr double MISSTATED = 2.0;

std::vector<plant::Case> casesOf(const Options& o) {
  std::vector<plant::Case> cases = plant::drawCases(o.counts, namesOf(o), o.seed, o.outside_kinds);
  for (std::size_t k = 0; o.misstated > 0 && k < cases.size(); ++k) {
    if ((k + 1) % static_cast<std::size_t>(o.misstated) == 0) cases[k].nominal_errors = MISSTATED;
  }
  return cases;
}

// Results of an earlier run of the same bench, by case.
std::map<int, json> readLines(const std::string& file) {
  std::map<int, json> lines;
  for (const json& line : readJsonLines(file)) lines[line["case"]] = line;
  return lines;
}

// Without a folder only the line is stored.
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
  checkOutsideKinds(o.outside_kinds);
  std::vector<plant::Case> cases = casesOf(o);
  if (o.cases > static_cast<int>(cases.size()))
    throw UsageError("--cases: " + std::to_string(cases.size()) +
                     " are drawn by --singles, --pairs and so on");
  if (o.cases > 0) cases.resize(static_cast<std::size_t>(o.cases));
  o.one.check(static_cast<int>(cases.size()));
  if (o.one.one()) return runOne(o, cases[static_cast<std::size_t>(o.one.number)]);
  if (o.out.empty()) throw UsageError("--out: expected a folder for cases and scores");
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
      "Blind bench of explain: hides causes in random machines whose physics differs from the twin's, and "
      "scores the named effects. Continues an earlier run in the same folder."};
  line.option("-o,--out", o.out, "folder of cases and scores; optional with --case");
  line.option("--singles", o.counts.singles, "cases of each single effect");
  line.option("--pairs", o.counts.pairs, "pairs of effects");
  line.option("--triples", o.counts.triples, "cases of three effects");
  line.option("--none", o.counts.none, "cases with nothing hidden");
  line.option("--outside", o.counts.outside, "cases with a cause outside the catalogue");
  line.option("--outside-kinds", o.outside_kinds,
              "kinds of outside causes, comma separated (default: those of the bench)")
      .commas();
  line.option("--misstated", o.misstated,
              "every Nth case has nominal values off by twice their stated uncertainty (default: none)")
      .notNegative();
  line.option("--only", o.only, "effects to draw from, comma separated").commas();
  line.option("--cases", o.cases, "number of cases, from the first (default: all)").notNegative();
  line.option("--case", o.one.number, "only this case, with progress on standard error");
  o.one.addScore(line);
  line.option("--seed", o.seed, "seed of all random draws");
  line.option("--threads", o.threads, "parallel cases").within(1, 64);
  line.flag("--keep", o.keep, "keep also the campaigns of correct cases");
  return runProgram(line, argc, argv, [&] { run(o); });
}
