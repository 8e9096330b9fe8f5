// rosrun smartmill_studies discrepancy_bench: hides causes in drawn machines, lets explain find them, opens
// the seal and scores.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "discrepancy/bench_campaign.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/program.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_discrepancy/report/report_json.h"

namespace {

using namespace smartmill;
using namespace smartmill::discrepancy;

struct Case {
  std::string kind;  // single, pair, triple, none, outside
  std::vector<std::string> names;
};

struct Options {
  std::string out, only;
  int singles = 0, pairs = 0, triples = 0, none = 0, outside = 0, threads = 2, substeps = 16, only_case = -1;
  std::uint64_t seed = 1;
  bool keep = false, exact_nominal = false;
};

bool needsFlexible(const Case& c) {
  return std::any_of(c.names.begin(), c.names.end(), [](const std::string& name) {
    return findEffect(name)->has(EffectNeed::flexible_tool);
  });
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
  const auto several = [&](const std::string& kind, std::size_t effects) {
    std::vector<std::string> drawn;
    while (drawn.size() < effects) {
      const std::string& name = names[pick(random)];
      if (std::find(drawn.begin(), drawn.end(), name) == drawn.end()) drawn.push_back(name);
    }
    cases.push_back({kind, drawn});
  };
  for (int k = 0; k < o.pairs; ++k) several("pair", 2);
  for (int k = 0; k < o.triples; ++k) several("triple", 3);
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
      const double difference = parameterOf(*findEffect(found.name), key).difference(p.value, value);
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

// What one case came to.
struct Outcome {
  std::string expected, found;  // names; nothing
  std::string verdict;          // or why the campaign was refused
  std::vector<std::string> named;
  Explanation explanation;
  bool right = false, false_effect = false;
  double largest_score = 0.0;
};

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : "+") + name;
  return text;
}

// Draws a machine, hides the causes of a case in it and writes its campaign.
BenchTruth hide(const Options& o, const Case& c, int number, std::uint64_t seed, const std::string& folder) {
  BenchTruth truth;
  std::mt19937_64 own(seed);
  const MachineModel nominal = drawMachine(own, needsFlexible(c));
  truth.machine = o.exact_nominal ? nominal : drawTruth(nominal, own);
  for (const std::string& name : c.names) truth.machine.effects.push_back(drawEffect(name, nominal, own));
  if (c.kind == "outside") truth.outside = drawOutside(own);
  writeBenchCampaign(nominal, truth, folder, seed + 1, o.substeps);
  writeMachineModel(truth.machine, o.out + "/sealed_" + std::to_string(number) + ".yaml");
  return truth;
}

// Looks for the causes with nothing but the campaign.
Outcome look(const Options& o, const std::string& folder) {
  Outcome outcome;
  Explanation& e = outcome.explanation;
  try {
    const Campaign campaign = readCampaign(folder);
    const Dataset data = loadDataset(campaign, readMachineModel(campaign.modelPath()));
    ExplainOptions options;
    options.bench.threads = 1;
    if (o.only_case >= 0)
      options.search.progress = [](const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); };
    std::filesystem::create_directories(folder + "/report");
    e = explain(data, options, folder + "/report");
    writeReport(e, folder + "/report");
    outcome.verdict = nameOf(e.verdict);
  } catch (const Error& error) {
    outcome.verdict = std::string("refused: ") + error.what();
  }
  for (const FoundEffect& f : e.effects) outcome.named.push_back(f.name);
  outcome.found = joined(outcome.named);
  return outcome;
}

void scoreOutside(const OutsideCause& truth, Outcome* outcome) {
  const Explanation& e = outcome->explanation;
  outcome->expected = "outside: " + truth.kind + " " + truth.channel;
  outcome->right = (outcome->verdict == "unknown_effect" || outcome->verdict == "partly_explained") &&
                   !e.unexplained.empty() && e.unexplained.front().channel == truth.channel &&
                   e.unexplained.front().domain == truth.domain();
  outcome->false_effect = outcome->verdict == "explained";
  for (const Finding& f : e.unexplained) outcome->found += " [" + f.channel + " " + f.domain + "]";
}

void scoreNothing(Outcome* outcome) {
  outcome->expected = "nothing";
  outcome->false_effect = !outcome->explanation.effects.empty();
  outcome->right = outcome->verdict == "no_disagreement";
}

void scoreNames(const Case& c, const std::vector<EffectEntry>& truth, Outcome* outcome) {
  const std::vector<FoundEffect>& effects = outcome->explanation.effects;
  outcome->expected = joined(c.names);
  outcome->right = true;
  for (std::size_t k = 0; k < c.names.size(); ++k) {
    const auto same = [&](const FoundEffect& f) { return f.name == c.names[k]; };
    const auto at = std::find_if(effects.begin(), effects.end(), same);
    outcome->right = outcome->right && (at != effects.end() || grouped(outcome->explanation, c.names[k]));
    if (at != effects.end())
      outcome->largest_score = std::max(outcome->largest_score, largestScore(*at, truth[k]));
  }
  // The first name is the one that explains most.
  if (c.kind == "single" && outcome->right) {
    const auto first = std::max_element(
        effects.begin(), effects.end(),
        [](const FoundEffect& a, const FoundEffect& b) { return a.delta_bic < b.delta_bic; });
    outcome->right = first->name == c.names.front() || grouped(outcome->explanation, c.names.front());
  }
  for (const FoundEffect& f : effects) {
    if (std::find(c.names.begin(), c.names.end(), f.name) == c.names.end()) outcome->false_effect = true;
  }
}

Outcome runCase(const Options& o, const Case& c, int number, std::uint64_t seed) {
  const std::string folder = o.out + "/case_" + std::to_string(number);
  // Sealed: nothing of the truth but the campaign reaches explain.
  const BenchTruth truth = hide(o, c, number, seed, folder);
  Outcome outcome = look(o, folder);
  if (truth.outside) {
    scoreOutside(*truth.outside, &outcome);
  } else if (c.names.empty()) {
    scoreNothing(&outcome);
  } else {
    scoreNames(c, truth.machine.effects, &outcome);
  }
  if (outcome.found.empty()) outcome.found = outcome.verdict;
  if (!o.keep && outcome.right) std::filesystem::remove_all(folder);
  return outcome;
}

// Rows: what was hidden; columns: what was named; the share of the row's cases.
void drawConfusion(const std::vector<Case>& cases, const std::vector<Outcome>& outcomes,
                   const std::string& png) {
  std::vector<std::string> hidden, named;
  std::map<std::pair<std::string, std::string>, int> count;
  std::map<std::string, int> all;
  const auto known = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (std::size_t k = 0; k < cases.size(); ++k) {
    if (cases[k].names.size() > 1) continue;
    const std::string truth = cases[k].kind == "outside" ? "outside" : outcomes[k].expected;
    known(hidden, truth);
    ++all[truth];
    std::vector<std::string> columns = outcomes[k].named;
    if (columns.empty()) columns.push_back(outcomes[k].verdict.substr(0, outcomes[k].verdict.find(':')));
    for (const std::string& c : columns) ++count[{truth, c}];
  }
  named = hidden;
  named.erase(std::remove_if(named.begin(), named.end(),
                             [](const std::string& n) { return n == "nothing" || n == "outside"; }),
              named.end());
  for (const auto& [key, n] : count) known(named, key.second);
  if (hidden.empty()) return;
  std::string data, program;
  for (const auto& [key, n] : count) {
    const auto x = std::find(named.begin(), named.end(), key.second) - named.begin();
    const auto y = std::find(hidden.begin(), hidden.end(), key.first) - hidden.begin();
    data += std::to_string(x) + " " + std::to_string(y) + " " +
            std::to_string(static_cast<double>(n) / all[key.first]) + " " + std::to_string(n) + "\n";
  }
  const auto tics = [](const std::vector<std::string>& names) {
    std::string text = "(";
    for (std::size_t k = 0; k < names.size(); ++k)
      text += (k ? ", '" : "'") + names[k] + "' " + std::to_string(k);
    return text + ")";
  };
  program =
      "$m << EOD\n" + data + "EOD\nset title 'hidden (rows) and named (columns)'\n" +
      "set palette defined (0 '#f7fbff', 1 '#08519c')\nset cbrange [0:1]\nset xtics rotate by -60 " +
      tics(named) + "\nset ytics " + tics(hidden) + "\nset xrange [-0.5:" + std::to_string(named.size()) +
      "-0.5]\nset yrange [" + std::to_string(hidden.size()) +
      "-0.5:-0.5]\nplot $m using 1:2:(0.5):(0.5):3 with boxxyerror fillstyle solid 1.0 border lc 'white' "
      "fc palette notitle, $m using 1:2:(sprintf('%d', $4)) with labels font ',8' tc rgb 'orange' notitle\n";
  (Gnuplot(png, 1100, 900, 10) << program).draw();
}

// Stated confidence of each named effect against the share that was really hidden.
void drawReliability(const std::vector<Case>& cases, const std::vector<Outcome>& outcomes,
                     const std::string& out) {
  const std::vector<double> edges{0.0, 0.8, 0.95, 0.99, 0.999, 1.0};
  struct Bin {
    double stated = 0.0, right = 0.0, all = 0.0;
  };
  std::vector<Bin> bins(edges.size() - 1);
  for (std::size_t k = 0; k < cases.size(); ++k) {
    for (const FoundEffect& f : outcomes[k].explanation.effects) {
      std::size_t b = 0;
      while (b + 2 < edges.size() && f.confidence >= edges[b + 1]) ++b;
      bins[b].stated += f.confidence;
      bins[b].all += 1.0;
      if (std::find(cases[k].names.begin(), cases[k].names.end(), f.name) != cases[k].names.end() ||
          std::any_of(cases[k].names.begin(), cases[k].names.end(),
                      [&](const std::string& name) { return grouped(outcomes[k].explanation, name); }))
        bins[b].right += 1.0;
    }
  }
  std::string data;
  std::ofstream csv(out + "/reliability.csv");
  csv << "stated,right,effects\n";
  for (const Bin& b : bins) {
    if (b.all == 0.0) continue;
    const double share = b.right / b.all;
    // Wilson's interval.
    const double z2 = 3.84, middle = (share + z2 / (2.0 * b.all)) / (1.0 + z2 / b.all);
    const double half =
        std::sqrt(z2 * (share * (1.0 - share) / b.all + z2 / (4.0 * b.all * b.all))) / (1.0 + z2 / b.all);
    char line[200];
    std::snprintf(line, sizeof line, "%.5f %.5f %.5f %.5f\n", b.stated / b.all, share, middle - half,
                  middle + half);
    data += line;
    csv << b.stated / b.all << "," << share << "," << b.all << "\n";
    std::printf("stated confidence %.4f: %.0f of %.0f named effects right\n", b.stated / b.all, b.right,
                b.all);
  }
  if (data.empty()) return;
  Gnuplot picture(out + "/reliability.png", 700, 650, 10);
  picture << "$r << EOD\n"
          << data
          << "EOD\nset title 'reliability of the stated confidence'\nset xlabel 'stated'\nset ylabel "
             "'share right'\nset xrange [0.4:1.02]\nset yrange [0:1.05]\nset key left\nplot x with lines "
             "dt 2 lc 'gray' title 'ideal', $r using 1:2:3:4 with yerrorbars pt 7 title 'named effects'\n";
  picture.draw();
}

void run(const Options& o) {
  std::mt19937_64 random(o.seed);
  std::filesystem::create_directories(o.out);
  std::ofstream table(o.out + "/cases.csv");
  table << "case,kind,truth,verdict,found,right,largest_z,gap_before,gap_after,heldout_after,seconds\n";
  const std::vector<Case> cases = drawCases(o, random);
  std::vector<std::uint64_t> seeds;
  for (std::size_t k = 0; k < cases.size(); ++k) seeds.push_back(random());
  std::vector<Outcome> outcomes(cases.size());
  std::mutex mutex;
  runParallel(cases.size(), o.threads, [&](std::size_t k) {
    if (o.only_case >= 0 && static_cast<int>(k) != o.only_case) return;
    Outcome outcome = runCase(o, cases[k], static_cast<int>(k), seeds[k]);
    const Explanation& e = outcome.explanation;
    char line[600];
    std::snprintf(line, sizeof line, "%zu,%s,%s,%s,%s,%d,%.2f,%.3f,%.4f,%.4f,%.1f", k, cases[k].kind.c_str(),
                  outcome.expected.c_str(), outcome.verdict.c_str(), outcome.found.c_str(),
                  outcome.right ? 1 : 0, outcome.largest_score, e.before.fit, e.after.fit, e.after.heldout,
                  e.seconds);
    const std::lock_guard<std::mutex> lock(mutex);
    table << line << std::endl;
    std::printf("%s\n", line);
    std::fflush(stdout);
    outcomes[k] = std::move(outcome);
  });
  std::map<std::string, std::pair<int, int>> score;  // right, all
  std::map<std::pair<std::string, std::string>, int> confusion;
  int named = 0, low_gap = 0, false_effects = 0, close = 0, scored = 0;
  if (o.only_case >= 0) return;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    const Outcome& r = outcomes[k];
    ++confusion[{r.expected, r.found}];
    score[cases[k].kind].first += r.right;
    ++score[cases[k].kind].second;
    if (cases[k].kind == "none" || cases[k].kind == "outside") false_effects += r.false_effect;
    if (cases[k].names.empty() || !r.right) continue;
    ++named;
    low_gap += r.explanation.after.heldout <= 1.1;
    ++scored;
    close += r.largest_score <= 3.0;
  }
  std::ofstream matrix(o.out + "/confusion.csv");
  matrix << "truth,found,cases\n";
  for (const auto& [key, count] : confusion) matrix << key.first << "," << key.second << "," << count << "\n";
  for (const auto& [kind, counts] : score)
    std::printf("%s: %d of %d right\n", kind.c_str(), counts.first, counts.second);
  if (score.count("none") || score.count("outside"))
    std::printf("catalogue effect named as sufficient where none was hidden: %d\n", false_effects);
  if (named > 0) {
    std::printf("held-out gap at most 1.1: %d of %d named cases\n", low_gap, named);
    std::printf("every parameter within three standard deviations: %d of %d\n", close, scored);
  }
  drawConfusion(cases, outcomes, o.out + "/confusion.png");
  drawReliability(cases, outcomes, o.out);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CommandLine line{"Blind bench of explain: hides causes in drawn machines and scores what is named."};
  line.option("-o,--out", o.out, "folder of cases and scores").required();
  line.option("--singles", o.singles, "cases of each single effect");
  line.option("--pairs", o.pairs, "pairs of effects");
  line.option("--triples", o.triples, "cases of three effects");
  line.option("--none", o.none, "cases with nothing hidden");
  line.option("--outside", o.outside, "cases with a cause outside the catalogue");
  line.option("--only", o.only, "effects to draw from, comma separated");
  line.option("--case", o.only_case, "only this case of those drawn, with its progress");
  line.option("--seed", o.seed, "of everything drawn");
  line.option("--threads", o.threads, "cases at a time").within(1, 64);
  line.option("--substeps", o.substeps, "integration steps a sample of the hidden machine").within(2, 64);
  line.flag("--keep", o.keep, "keep the campaigns of right cases too");
  line.flag("--exact-nominal", o.exact_nominal, "nominal values are true");
  return runProgram(line, argc, argv, [&] { run(o); });
}
