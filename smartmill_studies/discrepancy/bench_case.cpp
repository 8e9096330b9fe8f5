#include "discrepancy/bench_case.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/report/report_json.h"

namespace smartmill::discrepancy {
namespace {

using nlohmann::json;

// Errors of the found parameters in their standard deviations.
std::vector<double> scores(const FoundEffect& found, const EffectEntry& truth) {
  std::vector<double> all;
  const auto numbers = numbersOf(truth);
  for (const FoundParameter& p : found.parameters) {
    for (const auto& [key, value] : numbers) {
      if (key != p.key || p.std_dev <= 0.0) continue;
      all.push_back(std::abs(parameterOf(*findEffect(found.name), key).difference(p.value, value)) /
                    p.std_dev);
    }
  }
  return all;
}

// Lower bound for any model: the gap between two runs of the plant over root 2, over the tests and channels
// that a gap counts.
double floorOf(const Dataset& data, bool heldout, const std::vector<Record>& one,
               const std::vector<Record>& other) {
  double squares = 0.0, count = 0.0;
  for (std::size_t k = 0; k < one.size(); ++k) {
    const std::string& name = data.campaign.tests[k].name;
    const auto test = std::find_if(data.tests.begin(), data.tests.end(),
                                   [&](const TestData& t) { return t.test.name == name; });
    if (test == data.tests.end() || test->heldout != heldout || test->test.kind == TestKind::tap) continue;
    for (const std::string& channel : test->channels) {
      const std::vector<double>&x = one[k].column(channel), &y = other[k].column(channel);
      for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i)
        squares += std::pow((x[i] - y[i]) / data.noise.at(channel), 2);
      count += static_cast<double>(x.size());
    }
  }
  return count > 0.0 ? std::sqrt(0.5 * squares / count) : 0.0;
}

Dataset loaded(const std::string& folder) {
  const Campaign campaign = readCampaign(folder);
  return loadDataset(campaign, readMachineModel(campaign.modelPath()));
}

Explanation explainCase(const Dataset& data, const std::string& folder,
                        const std::function<void(const std::string&)>& progress) {
  ExplainOptions options;
  options.bench.threads = 1;
  options.search.on_log = progress;
  std::filesystem::create_directories(folder + "/report");
  Explanation e = explain(data, options, folder + "/report");
  writeReport(e, folder + "/report");
  return e;
}

bool isEmpirical(const FoundEffect& f) {
  return findEffect(f.name)->empirical();
}

bool isRight(const plant::Case& hidden, const Explanation& e) {
  if (hidden.kind == "none") return e.effects.empty();
  // No name is correct for a cause outside the catalogue; the residual must be reported.
  if (hidden.kind == "outside")
    return std::all_of(e.effects.begin(), e.effects.end(), isEmpirical) &&
           e.verdict == Verdict::unknown_effect;
  const auto found = [&](const std::string& name) {
    return std::any_of(e.effects.begin(), e.effects.end(),
                       [&](const FoundEffect& f) { return standsFor(e, f.name, name); });
  };
  if (!std::all_of(hidden.names.begin(), hidden.names.end(), found)) return false;
  if (hidden.kind != "single") return true;
  // The first name explains most.
  const auto first =
      std::max_element(e.effects.begin(), e.effects.end(),
                       [](const FoundEffect& a, const FoundEffect& b) { return a.delta_bic < b.delta_bic; });
  return standsFor(e, first->name, hidden.names.front());
}

bool isHidden(const plant::Case& hidden, const Explanation& e, const std::string& name) {
  return std::any_of(hidden.names.begin(), hidden.names.end(),
                     [&](const std::string& h) { return standsFor(e, name, h); });
}

void score(const plant::Case& hidden, const plant::Drawn& drawn, const Explanation& e, json* line) {
  json& out = *line;
  out["verdict"] = nameOf(e.verdict);
  out["right"] = isRight(hidden, e);
  bool false_effect = false;
  std::vector<double> all;
  for (const FoundEffect& f : e.effects) {
    if (isEmpirical(f)) {
      out["empirical"].push_back(f.name.substr(f.name.find(':') + 1));
      false_effect = false_effect || hidden.kind == "none";
      continue;
    }
    const bool right = hidden.kind != "outside" && isHidden(hidden, e, f.name);
    false_effect = false_effect || !right;
    out["named"].push_back({{"name", f.name}, {"confidence", f.confidence}, {"right", right}});
    for (const EffectEntry& truth : drawn.plant.effects) {
      if (truth.name != f.name) continue;
      const std::vector<double> some = scores(f, truth);
      all.insert(all.end(), some.begin(), some.end());
    }
  }
  out["false_effect"] = false_effect;
  out["parameters"] = all.size();
  out["inside"] = std::count_if(all.begin(), all.end(), [](double z) { return z <= 1.96; });
  out["largest_z"] = all.empty() ? 0.0 : *std::max_element(all.begin(), all.end());
  out["gap_before"] = e.before.fit;
  out["gap_after"] = e.after.fit;
  out["heldout_before"] = (e.named_only ? *e.named_only : e.after).heldout;
  out["heldout_after"] = e.after.heldout;
  out["seconds"] = e.seconds;
}

}  // namespace

json runBenchCase(const plant::Case& hidden, int number, const std::string& folder,
                  const std::function<void(const std::string&)>& progress) {
  json line{{"case", number},         {"kind", hidden.kind},
            {"hidden", hidden.names}, {"vibrating", hidden.vibrating},
            {"named", json::array()}, {"empirical", json::array()},
            {"right", false},         {"false_effect", false}};
  const plant::Drawn drawn = plant::draw(hidden);
  const std::vector<Record> records = plant::runCampaign(drawn, hidden);
  plant::writeCampaignOf(drawn, records, folder);
  try {
    const Dataset data = loaded(folder);
    const std::vector<Record> again = plant::runCampaign(drawn, hidden, true);
    line["floor"] = floorOf(data, false, records, again);
    line["heldout_floor"] = floorOf(data, true, records, again);
    score(hidden, drawn, explainCase(data, folder, progress), &line);
  } catch (const Error& error) {
    line["verdict"] = std::string("refused: ") + error.what();
  }
  plant::writeTruth(drawn, folder + "/truth.yaml");
  return line;
}

}  // namespace smartmill::discrepancy
