#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <map>
#include <vector>

#include <CLI/CLI.hpp>

#include "smartmill_core/signal/statistics.h"
#include "study/machine_cases.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

void row(const char* name, std::vector<double> errors, double inside) {
  for (double& e : errors) e = 100.0 * std::abs(e);
  std::printf("%-34s %8.2f %8.2f %8.2f", name, median(errors), percentile(errors, 0.95),
              *std::max_element(errors.begin(), errors.end()));
  if (inside >= 0.0) std::printf("   %5.1f %%", 100.0 * inside);
  std::printf("\n");
}

void machines(unsigned first, int count) {
  const Faults faults;
  std::vector<double> thesis_ktc, thesis_kte, ktc, kte;
  double inside_ktc = 0.0, inside_kte = 0.0, z2 = 0.0;
  std::map<std::string, int> terms;
  for (int i = 0; i < count; ++i) {
    if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\rcase %d of %d", i + 1, count);
    const CaseErrors e = judge(drawCase(first + static_cast<unsigned>(i), faults), faults);
    thesis_ktc.push_back(e.thesis_ktc);
    thesis_kte.push_back(e.thesis_kte);
    ktc.push_back(e.ktc);
    kte.push_back(e.kte);
    inside_ktc += std::abs(e.z_ktc) < 1.96;
    inside_kte += std::abs(e.z_kte) < 1.96;
    z2 += e.z_ktc * e.z_ktc / count;
    for (const std::string& t : e.terms) ++terms[t];
  }
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\n");
  std::printf(
      "%d cases: rounding 3e-4 V, noise 0.2 mV, lag 7 Hz, warm-up, Stribeck, depth 2 %%, runout to 12 um\n",
      count);
  std::printf("%-34s %8s %8s %8s   %s\n", "|error| [%]", "median", "95 %", "worst", "inside 1.96 std");
  row("Ktc, thesis to the letter", thesis_ktc, -1.0);
  row("Ktc, records with law by evidence", ktc, inside_ktc / count);
  row("Kte, thesis to the letter", thesis_kte, -1.0);
  row("Kte, records with law by evidence", kte, inside_kte / count);
  std::printf("variance of the z-score of Ktc %.2f; chosen:", z2);
  for (const auto& [term, times] : terms) std::printf(" %s in %d;", term.c_str(), times);
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Randomised cases with known truth: what the estimators reach.");
  int count = 200;
  unsigned first = 1;
  app.add_option("--cases", count, "how many")->capture_default_str()->check(CLI::Range(2, 100000));
  app.add_option("--seed", first, "of the first case")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    machines(first, count);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "loadmeter_study: %s\n", error.what());
    return 1;
  }
  return 0;
}
