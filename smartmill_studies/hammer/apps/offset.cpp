// rosrun smartmill_studies hammer_offset [--machines N] [--seed N] [-o DIR]

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <filesystem>
#include <string>

#include "hammer/offset_cases.h"
#include "hammer/tip_figures.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using namespace smartmill::studies;

struct Request {
  int machines = 100;
  unsigned seed = 14;
  double noise = 0.005;
  std::string out;
  StudyCase one;
};

/// Modes below this share of the largest gain have no influence on a chart.
constexpr double COUNTS = 0.03;

/// [m/N] The depth limit of a slot is proportional to -1 / (2 Re H) at the most negative Re H, as in
/// figure 4.8.
double softest(const FrequencyResponse& frf) {
  double least = 0.0;
  for (std::size_t i = 0; i < frf.size(); ++i) {
    if (frf.frequency[i] >= 100.0 && frf.frequency[i] <= 5000.0) least = std::min(least, frf.value[i].real());
  }
  return -least;
}

struct Tally {
  std::vector<double> gains, frfs, depths;
  int stated = 0, inside = 0;

  void add(double gain, double std) {
    gains.push_back(std::abs(gain));
    stated += std > 0.0;
    inside += std > 0.0 && std::abs(gain) < 1.96 * std;
  }

  void add(const OffsetOutcome& outcome, int method) {
    frfs.push_back(outcome.frf_error[method]);
    for (const GainError& e : outcome.modes[method]) {
      if (e.share >= COUNTS) add(e.error, e.std);
    }
    depths.push_back(std::abs(softest(outcome.truth) / softest(outcome.frf[method]) - 1.0));
  }
};

void save(const OffsetOutcome& outcome, const std::string& folder, int machine) {
  std::filesystem::create_directories(folder);
  CsvWriter csv(
      "frequency_hz,truth_real,truth_imag,none_real,none_imag,eq_4_44_real,eq_4_44_imag,apart_real,apart_"
      "imag,"
      "apart_std,two_heights_real,two_heights_imag",
      8);
  for (std::size_t i = 0; i < outcome.truth.size(); ++i) {
    const auto at = [&](int w) { return outcome.frf[w].value[i]; };
    csv.row(outcome.truth.frequency[i], outcome.truth.value[i].real(), outcome.truth.value[i].imag(),
            at(0).real(), at(0).imag(), at(1).real(), at(1).imag(), at(2).real(), at(2).imag(),
            outcome.frf[2].std_dev[i], at(3).real(), at(3).imag());
  }
  csv.save(folder + "/machine_" + std::to_string(machine) + ".csv");
  drawSlotLimits({{"direct, at the tip", outcome.truth},
                  {"no correction", outcome.frf[0]},
                  {"eq. 4.44", outcome.frf[1]},
                  {"receptance coupling", outcome.frf[2]}},
                 folder + "/figure_4_8_machine_" + std::to_string(machine) + ".png");
}

/// One machine with its own seed.
void runOne(const Request& request) {
  request.one.check(request.machines);
  std::mt19937_64 random(seedOfCase(request.seed, request.one.number));
  const OffsetCase drawn = drawOffsetCase(random);
  nlohmann::json line{{"case", request.one.number}, {"failed", false}};
  try {
    const OffsetOutcome outcome = judgeOffset(drawn, request.noise, random);
    for (int w = 0; w < TIP_METHODS; ++w) {
      Tally tally;
      tally.add(outcome, w);
      nlohmann::json modes =
          nlohmann::json::array();  // relative error of the gain, and its standard deviation
      for (const GainError& e : outcome.modes[w])
        if (e.share >= COUNTS) modes.push_back({e.error, e.std});
      line[nameOf(static_cast<TipMethod>(w))] = {
          {"modes", modes}, {"frf", tally.frfs.front()}, {"least_depth", tally.depths.front()}};
    }
  } catch (const Error& error) {
    line["failed"] = true;
    line["why"] = error.what();
  }
  request.one.print(line);
}

void report(const Tally (&tallies)[TIP_METHODS], int machines, int failed) {
  std::printf("%d machines, %d failed; modes below 5 kHz with at least %.0f %% of the largest gain\n",
              machines, failed, 100.0 * COUNTS);
  if (failed == machines) return;
  std::printf("%-24s %-22s %-22s %-26s %s\n", "", "gain: median, 95 %", "FRF: median, 95 %",
              "least depth: median, 95 %", "within 1.96 deviations");
  for (int w = 0; w < TIP_METHODS; ++w) {
    const Tally& t = tallies[w];
    const auto show = [](const std::vector<double>& x) {
      return formatted("%.1f %%, %.1f %%", 100.0 * percentile(x, 0.5), 100.0 * percentile(x, 0.95));
    };
    std::printf("%-24s %-22s %-22s %-26s", nameOf(static_cast<TipMethod>(w)).c_str(), show(t.gains).c_str(),
                show(t.frfs).c_str(), show(t.depths).c_str());
    if (w >= 2 && t.stated > 0)
      std::printf(" %d of %d (%.0f %%)", t.inside, t.stated, 100.0 * t.inside / t.stated);
    std::printf("\n");
  }
}

void score(const std::string& file) {
  Tally tallies[TIP_METHODS];
  int machines = 0, failed = 0;
  for (const nlohmann::json& line : readJsonLines(file)) {
    ++machines;
    failed += line.at("failed").get<bool>();
    if (line.at("failed")) continue;
    for (int w = 0; w < TIP_METHODS; ++w) {
      const nlohmann::json& method = line.at(nameOf(static_cast<TipMethod>(w)));
      for (const nlohmann::json& mode : method.at("modes")) tallies[w].add(mode.at(0), mode.at(1));
      tallies[w].frfs.push_back(method.at("frf"));
      tallies[w].depths.push_back(method.at("least_depth"));
    }
  }
  if (machines == 0) throw Error(file + ": no case");
  report(tallies, machines, failed);
}

void run(const Request& request) {
  if (request.one.scores()) return score(request.one.lines);
  if (request.one.one()) return runOne(request);
  std::mt19937_64 random(request.seed);
  Tally tallies[TIP_METHODS];
  int failed = 0;
  for (int i = 0; i < request.machines; ++i) {
    const OffsetCase drawn = drawOffsetCase(random);
    try {
      const OffsetOutcome outcome = judgeOffset(drawn, request.noise, random);
      for (int w = 0; w < TIP_METHODS; ++w) tallies[w].add(outcome, w);
      if (!request.out.empty() && i < 10) save(outcome, request.out, i);
    } catch (const Error& error) {
      ++failed;
      std::printf("machine %d: %s\n", i, error.what());
    }
    if (i % 10 == 9) std::fprintf(stderr, "%d of %d\n", i + 1, request.machines);
  }
  report(tallies, request.machines, failed);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line(
      "FRF of the tip from an FRF measured above it: no correction, Dunwoody's eq. 4.44, receptance "
      "coupling.");
  request.one.addTo(line, "--machines,--cases", request.machines, "number of random tools and spindles");
  request.one.addScore(line);
  line.option("--seed", request.seed).showDefault();
  line.option("--noise", request.noise, "noise of the FRF as a share of its RMS").notNegative().showDefault();
  line.option("-o,--out", request.out, "folder for the FRFs of the first ten as CSV, and figure 4.8 of each");
  return runProgram(line, argc, argv, [&] { run(request); });
}
