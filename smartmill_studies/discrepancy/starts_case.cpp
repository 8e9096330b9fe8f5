#include "discrepancy/starts_case.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <vector>

#include <yaml-cpp/yaml.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "plant/machine.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/data/chatter.h"
#include "smartmill_discrepancy/explain/outcome.h"
#include "smartmill_discrepancy/explain/validate_effects.h"
#include "smartmill_discrepancy/search/refinement.h"
#include "study_case.h"

namespace smartmill::discrepancy {
namespace {

using nlohmann::json;
using Random = std::mt19937_64;

MachineModel truthOf(const Campaign& campaign) {
  MachineModel truth = readMachineModel(campaign.modelPath());
  for (const auto& effect : YAML::LoadFile(campaign.folder + "/truth.yaml")["effects"]) {
    std::map<std::string, double> numbers;
    for (const auto& key : effect.second) numbers[key.first.as<std::string>()] = key.second.as<double>();
    truth.effects.push_back(effectEntry(effect.first.as<std::string>(), numbers));
  }
  return truth;
}

bool isCompared(const std::string& coordinate) {
  return coordinate.rfind("cutting.", 0) == 0 || coordinate.rfind("tool_tip.", 0) == 0;
}

// Logarithms of the start's error factors, one per coordinate.
std::vector<double> drawFactors(const NominalFreedom& freedom, Random& random) {
  std::vector<double> logs;
  for (const Coordinate& c : freedom.coordinates()) {
    const double reach = c.name.find("frequency") == std::string::npos ? 0.5 : 0.02;
    const double factor = std::uniform_real_distribution<double>(1.0 - reach, 1.0 + reach)(random);
    logs.push_back(isCompared(c.name) ? std::log(factor) : 0.0);
  }
  return logs;
}

// The deepest cut, with its depth increased until it chatters.
void addChatteringCut(const MachineModel& truth, const std::string& folder, Random& random,
                      Campaign* campaign) {
  constexpr int TRIALS = 8;
  constexpr double DEEPER = 1.4;
  CampaignTest cut;
  for (const CampaignTest& t : campaign->tests) {
    if (t.engagement && (!cut.engagement || t.engagement->axial_depth > cut.engagement->axial_depth)) cut = t;
  }
  if (!cut.engagement) throw Error(campaign->folder + ": no cut");
  cut.name = "chattering";
  cut.file = cut.name + ".csv";
  plant::RunOptions options;
  options.show_tip = true;
  for (int trial = 0; trial < TRIALS; ++trial) {
    cut.engagement->axial_depth *= DEEPER;
    const Record record = plant::run(plant::plantOf(truth), cut, options, random);
    const auto first_cut = static_cast<std::size_t>(cut.engage_time.value_or(0.0) * cut.sample_rate);
    if (!findChatter(record, cut, first_cut)) continue;
    writeCsv(record, folder + "/" + cut.file);
    campaign->tests.push_back(cut);
    return;
  }
  throw Error(campaign->folder + ": no depth at which the deepest cut chatters");
}

// Writes a campaign folder with the records and the start as nominal model.
Campaign copyOf(const Campaign& campaign, const std::string& folder) {
  for (const CampaignTest& t : campaign.tests)
    std::filesystem::create_symlink(std::filesystem::absolute(campaign.pathOf(t)), folder + "/" + t.file);
  Campaign copy = campaign;
  copy.folder = folder;
  return copy;
}

void compare(const Workbench& bench, const FitResult& best, const std::vector<double>& off, json* line) {
  const std::vector<Coordinate>& coordinates = bench.freedom().coordinates();
  std::vector<Eigen::Index> places;
  for (std::size_t c = 0; c < coordinates.size(); ++c) {
    if (isCompared(coordinates[c].name)) places.push_back(static_cast<Eigen::Index>(c));
  }
  Eigen::VectorXd apart(static_cast<Eigen::Index>(places.size()));
  int within = 0;
  double largest = 0.0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const auto c = static_cast<std::size_t>(places[k]);
    apart[static_cast<Eigen::Index>(k)] = best.state.nominal[c] + off[c];
    const double deviations =
        std::abs(best.state.nominal[c] + off[c]) / std::sqrt(best.covariance(places[k], places[k]));
    within += deviations <= 2.0;
    largest = std::max(largest, deviations);
  }
  const Eigen::MatrixXd covariance = best.covariance(places, places);
  const double squares = apart.dot(linear::solveSymmetric(covariance, apart));
  (*line)["values"] = places.size();
  (*line)["within"] = within;
  (*line)["largest"] = largest;
  (*line)["distance"] = std::sqrt(squares / static_cast<double>(places.size()));
}

void fit(const Dataset& data, const std::vector<double>& off, json* line) {
  json& out = *line;
  WorkbenchOptions options;
  options.threads = 1;
  Workbench bench(data, options);
  out["chattering"] = std::count_if(data.tests.begin(), data.tests.end(),
                                    [](const TestData& t) { return t.chatter.has_value(); });
  out["gap_before"] = residualOf(bench, data.nominal).gap.fit;
  const SearchOptions searched;
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  SearchResult found = search(bench, hypotheses, searched);
  std::vector<Resemblance> resembles;
  validateEffects(bench, searched, &found, &resembles);
  found.best.covariance = robustCovariance(bench, found.best);
  bench.guidance().set(false);
  bench.alignment().alignTo(found.best.state);
  for (const Member& m : found.best.state.members) out["named"].push_back(m.hypothesis->title());
  compare(bench, found.best, off, line);
  const GapPair after = residualOf(bench, bench.exact().model(found.best.state)).gap;
  out["gap_after"] = after.fit;
  out["heldout_after"] = after.heldout;
  out["right"] = out["named"].empty() && out["distance"] <= 2.0;
}

}  // namespace

json runStart(const std::string& campaign_folder, bool chattering, std::uint64_t seed, int number) {
  const auto begin = std::chrono::steady_clock::now();
  json line{{"case", number}, {"campaign", campaign_folder}, {"named", json::array()}, {"right", false}};
  const TemporaryFolder scratch;
  const std::string folder = scratch.file("campaign");
  std::filesystem::create_directories(folder);
  const Campaign original = readCampaign(campaign_folder);
  const MachineModel truth = truthOf(original);
  Campaign campaign = copyOf(original, folder);
  Random random(seedOfCase(seed, number));
  const NominalFreedom freedom(truth);
  const std::vector<double> off = drawFactors(freedom, random);
  MachineModel start = freedom.apply(truth, off);
  start.uncertainty.cutting = start.uncertainty.damping = start.uncertainty.stiffness = 30.0;
  start.uncertainty.frequency = 1.2;
  start.cutting_std.reset();
  if (chattering) addChatteringCut(truth, folder, random, &campaign);
  campaign.model_file = "model.yaml";
  writeCampaign(campaign, folder);
  writeMachineModel(start, campaign.modelPath());
  try {
    fit(loadDataset(readCampaign(folder), readMachineModel(campaign.modelPath())), off, &line);
  } catch (const Error& error) {
    line["refused"] = error.what();
  }
  line["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return line;
}

}  // namespace smartmill::discrepancy
