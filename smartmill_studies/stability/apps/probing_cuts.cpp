// rosrun smartmill_studies stability_probing_cuts

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "stability/probing_cuts.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using namespace smartmill::stability;

struct Request {
  int machines = 200, cuts = 5;
  unsigned seed = 1;
  LearningOptions learning;
  StudyCase study;
};

nlohmann::json lineOf(const Request& request, int number) {
  const std::uint64_t seed = seedOfCase(request.seed, number);
  std::mt19937_64 random(seed);
  const UntappedMachine machine = drawUntappedMachine(random);
  LearningOptions learning = request.learning;
  learning.seed = seed;
  const ProbingResult result = probe(machine, request.cuts, learning, seed + 1);
  nlohmann::json line;
  line["case"] = number;
  line["stated"] = result.recommended ? result.recommended->stable : 0.0;
  line["recommended"] = result.recommended.has_value();
  line["stable"] = result.stable;
  line["removal"] = result.removal;
  line["most"] = {units::rpmFromRadPerSec(result.most.speed), result.most.depth / units::MM};
  if (result.recommended)
    line["cut"] = {units::rpmFromRadPerSec(result.recommended->speed), result.recommended->depth / units::MM};
  for (std::size_t k = 0; k < result.cuts.size(); ++k) {
    const JudgedCut& cut = result.cuts[k];
    line["cuts"].push_back({units::rpmFromRadPerSec(cut.speed), cut.depth / units::MM, cut.chatter,
                            cut.frequency ? cut.frequency->value : 0.0, result.proposed[k].stable});
  }
  return line;
}

void score(const std::vector<nlohmann::json>& lines) {
  std::vector<double> removal;
  int recommended = 0, stable = 0, chattered = 0, cuts = 0;
  constexpr std::size_t BINS = 5;
  std::array<double, BINS> stated{}, observed{}, size{};
  for (const nlohmann::json& line : lines) {
    recommended += line.at("recommended").get<bool>();
    stable += line.at("stable").get<bool>();
    // A cut that chatters removes nothing.
    removal.push_back(line.at("stable").get<bool>() ? numberOf(line, "removal") : 0.0);
    for (const nlohmann::json& cut : line.at("cuts")) {
      ++cuts;
      chattered += cut.at(2).get<bool>();
      const double p = cut.at(4).get<double>();
      const auto bin = std::min(BINS - 1, static_cast<std::size_t>(BINS * p));
      stated[bin] += p;
      observed[bin] += !cut.at(2).get<bool>();
      ++size[bin];
    }
  }
  std::sort(removal.begin(), removal.end());
  const auto count = lines.size();
  const auto quantile = [&](double share) {
    return removal[static_cast<std::size_t>(share * static_cast<double>(count - 1))];
  };
  std::printf("machines %zu: recommended %d, stable %d (%.1f %%)\n", count, recommended, stable,
              100.0 * stable / static_cast<double>(count));
  std::printf("removal over the most of the exact chart: 10 %% %.3f, 25 %% %.3f, median %.3f, 75 %% %.3f\n",
              quantile(0.1), quantile(0.25), quantile(0.5), quantile(0.75));
  std::printf("cuts that chattered: %d of %d\nprobability of a stable cut: stated, observed, cuts\n",
              chattered, cuts);
  for (std::size_t bin = 0; bin < BINS; ++bin)
    if (size[bin] > 0.0)
      std::printf("%6.3f %6.3f %5.0f\n", stated[bin] / size[bin], observed[bin] / size[bin], size[bin]);
}

void run(const Request& request) {
  if (request.study.scores()) {
    score(readJsonLines(request.study.lines));
    return;
  }
  request.study.check(request.machines);
  if (request.study.one()) {
    request.study.print(lineOf(request, request.study.number));
    return;
  }
  std::vector<nlohmann::json> lines;
  for (int k = 0; k < request.machines; ++k) {
    lines.push_back(lineOf(request, k));
    std::fprintf(stderr, "\r%d of %d machines%s", k + 1, request.machines,
                 k + 1 == request.machines ? "\n" : "");
  }
  score(lines);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Recommended cuts of drawn machines after a few cuts, without a tap test: whether they "
      "are stable, and what they remove of what the exact chart allows."};
  request.study.addTo(line, "--machines", request.machines, "drawn machines");
  request.study.addScore(line);
  line.option("--cuts", request.cuts, "cuts before the recommendation (5)").within(0, 100);
  line.option("--seed", request.seed, "of the draws (1)");
  line.option("--risk", request.learning.risk, "largest probability of chatter of the recommended cut");
  line.option("--risk-offset", request.learning.risk_offset, "boldness of proposals [1]");
  line.option("--scatter", request.learning.scatter, "standard deviation of log(limit)");
  return runProgram(line, argc, argv, [&] { run(request); });
}
