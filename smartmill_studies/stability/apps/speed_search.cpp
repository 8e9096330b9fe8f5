// rosrun smartmill_studies stability_speed_search

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/program.h"
#include "stability/speed_tries.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using namespace smartmill::stability;

struct Request {
  int machines = 300;
  unsigned seed = 1;
};

constexpr int MOST = 20;  // tries

/// Tries of one rule over all machines.
struct Score {
  std::vector<int> counts;
  int failed = 0, above_six = 0;
  /// A machine without a stable cut counts as the most tries.
  void add(const Tries& tries) {
    const int count = tries.stable ? static_cast<int>(tries.speeds.size()) : MOST;
    failed += !tries.stable;
    above_six += count > 6;
    counts.push_back(count);
  }
  void print(const char* name) {
    std::sort(counts.begin(), counts.end());
    double mean = 0.0;
    for (const int count : counts) mean += static_cast<double>(count) / static_cast<double>(counts.size());
    const auto quantile = [&](double share) {
      return counts[static_cast<std::size_t>(share * static_cast<double>(counts.size() - 1))];
    };
    std::printf(
        "%-42s mean %.2f, median %d, 90 %% %d, 99 %% %d, largest %d; above six %d, none found %d of %zu\n",
        name, mean, quantile(0.5), quantile(0.9), quantile(0.99), counts.back(), above_six, failed,
        counts.size());
  }
};

void run(const Request& request) {
  Score search, fastest, nearest;
  constexpr std::size_t BINS = 5;
  std::array<double, BINS> stated{}, stable{}, size{};
  for (int k = 0; k < request.machines; ++k) {
    const std::uint64_t seed = seedOfCase(request.seed, k);
    std::mt19937_64 random(seed);
    const ChatteringCut cut = drawChatteringCut(random);
    const Tries by_search = bySearch(cut, seed, MOST);
    search.add(by_search);
    fastest.add(byRule(cut, seed, MOST, false));
    nearest.add(byRule(cut, seed, MOST, true));
    for (std::size_t i = 0; i < by_search.speeds.size(); ++i) {
      const auto bin = std::min(BINS - 1, static_cast<std::size_t>(BINS * by_search.stated[i]));
      stated[bin] += by_search.stated[i];
      stable[bin] += by_search.stable && i + 1 == by_search.speeds.size();
      ++size[bin];
    }
  }
  search.print("search");
  fastest.print("60 f / (N k), the fastest not tried");
  nearest.print("60 f / (N k), the nearest not tried");
  std::printf("probability of a stable cut: stated, observed, tries\n");
  for (std::size_t bin = 0; bin < BINS; ++bin)
    if (size[bin] > 0.0)
      std::printf("%6.3f %6.3f %5.0f\n", stated[bin] / size[bin], stable[bin] / size[bin], size[bin]);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{"Tries until a chattering cut is stable at the same depth, from its sound alone."};
  line.option("--machines", request.machines, "drawn machines (300)").within(1, 1000000);
  line.option("--seed", request.seed, "of the draws (1)");
  return runProgram(line, argc, argv, [&] { run(request); });
}
