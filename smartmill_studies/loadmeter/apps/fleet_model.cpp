// rosrun smartmill_studies loadmeter_fleet_model: learning across machines, in random shops with known truth.
#include <cstdio>
#include <vector>

#include "loadmeter/shop_case.h"
#include "smartmill_core/program.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using nlohmann::json;

double mean(const std::vector<json>& lines, const json::json_pointer& at) {
  double sum = 0.0;
  for (const json& line : lines) sum += line.at(at).get<double>() / static_cast<double>(lines.size());
  return sum;
}

double meanOf(const std::vector<json>& lines, const std::string& at) {
  return mean(lines, json::json_pointer("/" + at));
}

void report(const std::vector<json>& lines) {
  if (lines.empty()) throw Error("no case");
  const auto count = static_cast<double>(lines.size());
  std::printf("%zu shops of 50 machines\n%-34s %12s %12s %8s %8s\n", lines.size(),
              "first cuts of a material [% of Ktc]", "fleet", "alone", "z2", "inside");
  for (int cuts = 0; cuts <= 4; ++cuts) {
    const std::string after = "after_" + std::to_string(cuts);
    std::printf("%-34s %12.2f %12.2f %8.3f %8.3f\n", (std::to_string(cuts) + " own cuts").c_str(),
                meanOf(lines, after + "/fleet_percent"), meanOf(lines, after + "/alone_percent"),
                meanOf(lines, after + "/z2"), meanOf(lines, after + "/inside"));
  }
  std::printf("effects of machines: z2 %.3f, inside %.3f\n", meanOf(lines, "effects_z2"),
              meanOf(lines, "effects_inside"));
  std::printf("odd machines: %.0f of %.0f named, %.0f of %.0f others named\n",
              count * meanOf(lines, "odd_found"), count * meanOf(lines, "odd"),
              count * meanOf(lines, "odd_falsely"), count * (50.0 - meanOf(lines, "odd")));
  double named = 0.0, cuts = 0.0;
  for (const json& line : lines) {
    if (!line["newcomer_named"]) continue;
    ++named;
    cuts += line["newcomer_cuts"].get<double>();
  }
  std::printf(
      "newcomer that is 25 %% off: named in %.0f of %.0f shops within 12 cuts, after %.2f cuts in the mean\n",
      named, count, cuts / named);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Learning across machines: random shops of 50 machines, with two outliers in three of four shops.");
  int cases = 200;
  std::uint64_t seed = 1;
  StudyCase one;
  one.addTo(line, "--cases", cases, "shops");
  one.addScore(line);
  line.option("--seed", seed, "of all random draws").showDefault();
  return runProgram(line, argc, argv, [&] {
    one.check(cases);
    if (one.scores()) return report(readJsonLines(one.lines));
    if (one.one()) return one.print(loadmeter::runShop(seed, one.number));
    std::vector<json> lines;
    for (int k = 0; k < cases; ++k) {
      lines.push_back(loadmeter::runShop(seed, k));
      std::fprintf(stderr, "%d of %d shops\n", k + 1, cases);
    }
    report(lines);
  });
}
