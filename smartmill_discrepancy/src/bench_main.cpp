// rosrun smartmill_discrepancy bench: hides causes in drawn machines, lets explain find them, opens the seal
// and scores.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_discrepancy/bench_campaign.h"
#include "smartmill_discrepancy/explanation.h"

namespace {

using namespace smartmill;
using namespace smartmill::discrepancy;

struct Case {
  std::string kind;  // single, pair, none, outside
  std::vector<std::string> names;
};

struct Options {
  std::string out, only;
  int singles = 0, pairs = 0, none = 0, outside = 0, threads = 2, substeps = 16;
  std::uint64_t seed = 1;
  bool keep = false, exact_nominal = false;
};

bool needsFlexible(const Case& c) {
  return std::find(c.names.begin(), c.names.end(), "process_damping") != c.names.end();
}

std::vector<Case> drawCases(const Options& o, std::mt19937_64& random) {
  std::vector<std::string> names;
  for (const EffectKind& kind : effectCatalogue()) {
    if (o.only.empty() || ("," + o.only + ",").find("," + kind.name + ",") != std::string::npos)
      names.push_back(kind.name);
  }
  std::vector<Case> cases;
  for (int k = 0; k < o.singles; ++k) {
    for (const std::string& name : names) cases.push_back({"single", {name}});
  }
  std::uniform_int_distribution<std::size_t> pick(0, names.size() - 1);
  while (static_cast<int>(cases.size()) < o.singles * static_cast<int>(names.size()) + o.pairs) {
    const std::string a = names[pick(random)], b = names[pick(random)];
    if (a != b) cases.push_back({"pair", {a, b}});
  }
  for (int k = 0; k < o.none; ++k) cases.push_back({"none", {}});
  for (int k = 0; k < o.outside; ++k) cases.push_back({"outside", {}});
  return cases;
}

// Largest distance of a found parameter from the truth, in its standard deviations.
double largestScore(const FoundEffect& found, const EffectEntry& truth) {
  double largest = 0.0;
  const auto numbers = numbersOf(truth);
  for (const FoundParameter& p : found.parameters) {
    for (const auto& [key, value] : numbers) {
      if (key != p.key || p.std_dev <= 0.0) continue;
      const double difference = key == "angle_deg" ? std::remainder(p.value - value, 360.0) : p.value - value;
      largest = std::max(largest, std::abs(difference) / p.std_dev);
    }
  }
  return largest;
}

bool grouped(const Explanation& e, const std::string& name) {
  for (const auto& group : e.not_separable) {
    if (std::find(group.begin(), group.end(), name) != group.end()) return true;
  }
  return false;
}

void run(const Options& o) {
  std::mt19937_64 random(o.seed);
  std::filesystem::create_directories(o.out);
  std::ofstream table(o.out + "/cases.csv");
  table << "case,kind,truth,verdict,found,right,largest_z,gap_before,gap_after,heldout_after,seconds\n";
  std::map<std::pair<std::string, std::string>, int> confusion;
  std::map<std::string, std::pair<int, int>> score;  // right, all
  int number = 0;
  for (const Case& c : drawCases(o, random)) {
    const std::string folder = o.out + "/case_" + std::to_string(number);
    const std::uint64_t seed = random();
    // Sealed: only this block knows the truth until explain is done.
    BenchTruth truth;
    {
      std::mt19937_64 own(seed);
      const MachineModel nominal = drawMachine(own, needsFlexible(c));
      truth.machine = o.exact_nominal ? nominal : drawTruth(nominal, own);
      for (const std::string& name : c.names) truth.machine.effects.push_back(drawEffect(name, nominal, own));
      if (c.kind == "outside") truth.outside = drawOutside(own);
      writeBenchCampaign(nominal, truth, folder, seed + 1, o.substeps);
      writeMachineModel(truth.machine, o.out + "/sealed_" + std::to_string(number) + ".yaml");
    }
    Explanation e;
    try {
      const Campaign campaign = readCampaign(folder);
      const Dataset data = loadDataset(campaign, readMachineModel(campaign.modelPath()));
      ExplainOptions options;
      options.search.threads = o.threads;
      std::filesystem::create_directories(folder + "/report");
      e = explain(data, options, folder + "/report");
      writeReport(e, folder + "/report");
    } catch (const Error& error) {
      e.verdict = std::string("refused: ") + error.what();
    }
    std::string expected, found;
    for (const std::string& name : c.names) expected += (expected.empty() ? "" : "+") + name;
    if (truth.outside) expected = truth.outside->kind + " " + truth.outside->channel;
    for (const FoundEffect& f : e.effects) found += (found.empty() ? "" : "+") + f.name;
    bool right = false;
    double largest = 0.0;
    if (c.kind == "outside") {
      right = (e.verdict == "unknown_effect" || e.verdict == "partly_explained") && !e.unexplained.empty() &&
              e.unexplained.front().channel == truth.outside->channel &&
              e.unexplained.front().domain == truth.outside->domain();
      for (const Finding& f : e.unexplained) found += " [" + f.channel + " " + f.domain + "]";
    } else {
      right = c.names.empty() ? e.verdict == "no_disagreement"
                              : e.verdict == "explained" && e.effects.size() == c.names.size();
      for (std::size_t k = 0; k < c.names.size(); ++k) {
        const auto same = [&](const FoundEffect& f) { return f.name == c.names[k]; };
        const auto at = std::find_if(e.effects.begin(), e.effects.end(), same);
        right = right && (at != e.effects.end() || grouped(e, c.names[k]));
        if (at != e.effects.end()) largest = std::max(largest, largestScore(*at, truth.machine.effects[k]));
      }
    }
    ++confusion[{expected.empty() ? "nothing" : expected, found.empty() ? e.verdict : found}];
    score[c.kind].first += right;
    ++score[c.kind].second;
    char line[600];
    std::snprintf(line, sizeof line, "%d,%s,%s,%s,%s,%d,%.2f,%.3f,%.4f,%.4f,%.1f", number, c.kind.c_str(),
                  expected.c_str(), e.verdict.c_str(), found.c_str(), right ? 1 : 0, largest, e.before.fit,
                  e.after.fit, e.after.heldout, e.seconds);
    table << line << std::endl;
    std::printf("%s\n", line);
    std::fflush(stdout);
    if (!o.keep && right) std::filesystem::remove_all(folder);
    ++number;
  }
  std::ofstream matrix(o.out + "/confusion.csv");
  matrix << "truth,found,cases\n";
  for (const auto& [key, count] : confusion) matrix << key.first << "," << key.second << "," << count << "\n";
  for (const auto& [kind, counts] : score)
    std::printf("%s: %d of %d right\n", kind.c_str(), counts.first, counts.second);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CLI::App app{"Blind bench of explain: hides causes in drawn machines and scores what is named."};
  app.add_option("-o,--out", o.out, "folder of cases and scores")->required();
  app.add_option("--singles", o.singles, "cases of each single effect");
  app.add_option("--pairs", o.pairs, "pairs of effects");
  app.add_option("--none", o.none, "cases with nothing hidden");
  app.add_option("--outside", o.outside, "cases with a cause outside the catalogue");
  app.add_option("--only", o.only, "effects to draw from, comma separated");
  app.add_option("--seed", o.seed, "of everything drawn");
  app.add_option("--threads", o.threads, "threads")->check(CLI::Range(1, 64));
  app.add_option("--substeps", o.substeps, "integration steps a sample of the hidden machine")
      ->check(CLI::Range(2, 64));
  app.add_flag("--keep", o.keep, "keep the campaigns of right cases too");
  app.add_flag("--exact-nominal", o.exact_nominal, "nominal values are true");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  try {
    run(o);
  } catch (const std::exception& e) {
    std::cerr << "bench: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
