// rosrun smartmill_studies stability_charts --cases 1000 --seed 1 [--case K]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "stability/bulk_charts.h"
#include "stability/reliability.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using nlohmann::json;

constexpr double CM3_PER_MIN = 60e6;  // in a m3/s

struct Request {
  int cases = 1000, speeds = 300;
  std::uint64_t seed = 1;
  double entry_deg = 90.0, exit_deg = 180.0, risk = 0.05;
  std::string range = "3000:24000", overhangs, method = "zero_order";
  StudyCase one;

  stability::ChartParameters parameters() const {
    stability::ChartParameters p;
    const auto [low, high] = pairOf("--speeds", range);
    p.speed_low = units::radPerSecFromRpm(low);
    p.speed_high = units::radPerSecFromRpm(high);
    p.speeds = speeds;
    p.entry = units::radFromDeg(entry_deg);
    p.exit = units::radFromDeg(exit_deg);
    p.method = method;
    p.use_modes = true;
    p.risk = risk;
    return p;
  }
  /// [m] overhang of a case, at even distances from the shortest to the longest.
  double overhang(int number) const {
    const auto [low, high] = pairOf("--overhangs-mm", overhangs);
    return (low + (high - low) * number / std::max(1, cases - 1)) * units::MM;
  }
  static std::pair<double, double> pairOf(const char* option, const std::string& text) {
    double low = 0.0, high = 0.0;
    char rest = 0;
    if (std::sscanf(text.c_str(), "%lf:%lf%c", &low, &high, &rest) != 2 || !(low > 0.0) || !(high > low))
      throw UsageError(std::string(option) + " " + text + ": expected LO:HI with 0 < LO < HI");
    return {low, high};
  }
};

/// Numbers of a line with their significant digits.
double rounded(double value) {
  return std::isfinite(value) ? std::stod(formatted("%.6g", value)) : value;
}

json lineOf(const Request& request, int number) {
  const bool swept = !request.overhangs.empty();
  // The cases of an overhang sweep share one tool with the same measurement errors.
  std::mt19937_64 random(swept ? request.seed : seedOfCase(request.seed, number));
  stability::ChartMachine machine = stability::drawChartMachine(random);
  if (swept) machine.setOverhang(request.overhang(number));
  const stability::BulkChart found = bulkChart(machine, request.parameters(), {}, random);
  json line{{"case", number},
            {"overhang_mm", rounded(machine.x.stickout / units::MM)},
            {"diameter_mm", rounded(machine.x.shank_diameter / units::MM)},
            {"teeth", machine.teeth},
            {"ktc_n_mm2", rounded(machine.ktc / units::N_PER_MM2)},
            {"first_mode_hz", rounded(found.first_mode)},
            {"least_limit_mm", rounded(found.chart.absolute_depth_limit / units::MM)},
            {"found", !found.chart.recommended.empty()}};
  json speeds = json::array(), limits = json::array();
  for (std::size_t k = 0; k < found.chart.limit.depth.size(); ++k) {
    speeds.push_back(rounded(units::rpmFromRadPerSec(found.chart.limit.spindle_speed[k])));
    limits.push_back(rounded(found.chart.limit.depth[k] / units::MM));
  }
  line["speeds_rpm"] = speeds;
  line["limits_mm"] = limits;  // null: stable at the largest depth of the search
  if (found.chart.recommended.empty()) return line;
  const StabilityPoint& best = found.chart.recommended.front();
  line["best"] = {{"speed_rpm", rounded(units::rpmFromRadPerSec(best.spindle_speed))},
                  {"depth_mm", rounded(best.axial_depth / units::MM)},
                  {"removal_cm3_min", rounded(best.material_removal_rate * CM3_PER_MIN)},
                  {"probability", rounded(found.probability)},
                  {"chatters", found.chatters}};
  return line;
}

void report(const std::vector<json>& lines) {
  if (lines.empty()) throw Error("no case");
  std::vector<double> removal, gain;
  double probability = 0.0;
  int chatter = 0;
  for (const json& line : lines) {
    if (!line.at("found")) continue;
    const json& best = line.at("best");
    removal.push_back(best.at("removal_cm3_min"));
    gain.push_back(best.at("depth_mm").get<double>() / line.at("least_limit_mm").get<double>());
    probability += best.at("probability").get<double>();
    chatter += best.at("chatters").get<bool>();
  }
  const auto count = static_cast<int>(removal.size());
  std::printf("%zu charts, %d with a point to cut at\n", lines.size(), count);
  if (count == 0) return;
  std::printf("best removal rate [cm3/min]: median %.1f, 5 %% %.1f, 95 %% %.1f\n", median(removal),
              percentile(removal, 0.05), percentile(removal, 0.95));
  std::printf("its depth over the critical limit: median %.2f, 95 %% %.2f\n", median(gain),
              percentile(gain, 0.95));
  const auto interval = stability::wilson(chatter, count);
  std::printf(
      "chatter there on the true machine: %d of %d (%.2f %%, 95 %%: %.2f .. %.2f), predicted %.2f %%\n",
      chatter, count, 100.0 * chatter / count, 100.0 * interval[0], 100.0 * interval[1],
      100.0 * probability / count);
}

void run(const Request& request) {
  request.one.check(request.cases);
  if (request.one.scores()) return report(readJsonLines(request.one.lines));
  if (request.one.one()) return request.one.print(lineOf(request, request.one.number));
  std::vector<json> lines;
  for (int k = 0; k < request.cases; ++k) {
    lines.push_back(lineOf(request, k));
    std::fprintf(stderr, "%d of %d charts\n", k + 1, request.cases);
  }
  report(lines);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Stability charts in bulk: of many random machines, or of one random machine over the overhang of its "
      "tool. Each is measured with errors; the best point of the chart is tested on the true machine."};
  request.one.addTo(line, "--cases", request.cases, "number of machines or overhangs");
  request.one.addScore(line);
  line.option("--seed", request.seed, "of the machines and of their measurement").showDefault();
  line.option("--overhangs-mm", request.overhangs, "LO:HI one machine, one chart for each overhang");
  line.option("--speeds", request.range, "LO:HI [rpm]").showDefault();
  line.option("--lines", request.speeds, "number of speeds of a chart").within(2, 100000).showDefault();
  line.option("--entry-deg", request.entry_deg, "immersion angle at which a tooth enters").showDefault();
  line.option("--exit-deg", request.exit_deg, "immersion angle at which a tooth leaves").showDefault();
  line.option("--method", request.method, "of the chart: zero_order or collocation").showDefault();
  line.option("--risk", request.risk, "largest probability of chatter of a recommended point")
      .within(0.0, 0.5)
      .showDefault();
  return runProgram(line, argc, argv, [&] { run(request); });
}
