#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <vector>

#include "loadmeter/machine_cases.h"
#include "loadmeter/turning_scene.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "study_case.h"

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
  double inside_ktc = 0.0, inside_kte = 0.0, z2 = 0.0, z2_kte = 0.0, depth2 = 0.0, rest2 = 0.0;
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
    z2_kte += e.z_kte * e.z_kte / count;
    rest2 += e.z_beside_depth * e.z_beside_depth / count;
    depth2 += e.depth * e.depth / (faults.depth_error * faults.depth_error) / count;
    for (const std::string& t : e.terms) ++terms[t];
  }
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\n");
  std::printf(
      "%d cases: rounding 3e-4 V, noise 0.2 mV, lag 7 Hz, warm-up, Stribeck, depth 2 %%, runout to 12 um\n",
      count);
  std::printf("%-34s %8s %8s %8s   %s\n", "|error| [%]", "median", "95 %", "worst", "inside 1.96 std");
  row("Ktc, thesis procedure", thesis_ktc, -1.0);
  row("Ktc, records with law by evidence", ktc, inside_ktc / count);
  row("Kte, thesis procedure", thesis_kte, -1.0);
  row("Kte, records with law by evidence", kte, inside_kte / count);
  std::printf(
      "mean square of the z-score: Ktc %.2f, Kte %.2f; Ktc with the true depth %.2f; of the depth errors "
      "drawn, over their 2 %%: %.2f "
      "(chance "
      "+- %.2f)\nchosen:",
      z2, z2_kte, rest2, depth2, std::sqrt(2.0 / count));
  for (const auto& [term, times] : terms) std::printf(" %s in %d;", term.c_str(), times);
  std::printf("\n");
}

// The same machine as in the complete study with that seed.
nlohmann::json lineOf(unsigned first, int number) {
  const Faults faults;
  const CaseErrors e = judge(drawCase(first + static_cast<unsigned>(number), faults), faults);
  return {{"case", number},  {"thesis_ktc", e.thesis_ktc}, {"thesis_kte", e.thesis_kte}, {"ktc", e.ktc},
          {"kte", e.kte},    {"z_ktc", e.z_ktc},           {"z_kte", e.z_kte},           {"depth", e.depth},
          {"terms", e.terms}};
}

void split(const char* name, const VarianceSplit& s, double process, double sensor) {
  std::printf(
      "%s: dynamometer %.1f N, %.0f N2 (put in %.0f); current %.1f N, %.0f N2; its share %.0f N2 (put in "
      "%.0f);"
      " F of the means %.2f, p %.3f; p of the variances %.2g\n",
      name, s.process_mean, s.process_variance, process, s.current_mean, s.current_variance,
      s.sensor_variance, sensor, s.f_means, s.p_means, s.p_variances);
}

void turning(unsigned seed) {
  const TurningVariances v;
  const TurningResult r = studyTurning(seed, v, 12);
  std::printf("\nturning centre, 120 calibration and 300 prediction tests, noise of Table 2\n");
  std::printf(
      "Fx = %.2f Ix + %.1f (paper -198.45, 258; R2 %.3f, paper 0.94); Fz = %.1f Iz + %.1f (215.9, 0.003;"
      " R2 %.3f, 0.943); torque law R2 %.3f (0.98)\n",
      r.x.slope.value, r.x.level.value, r.fit_x, r.z.slope.value, r.z.level.value, r.fit_z, r.fit_y);
  std::printf("%-34s %6s %6s %6s\n", "RMSE of prediction [N]", "Fx", "Fy", "Fz");
  std::printf("%-34s %6.0f %6.0f %6.0f   (tests %d, %d, %d)\n", "regression", r.regression.rmse[0],
              r.regression.rmse[1], r.regression.rmse[2], r.regression.count[0], r.regression.count[1],
              r.regression.count[2]);
  std::printf("%-34s %6d %6d %6d\n", "  paper, Table 1", 29, 36, 27);
  std::printf("%-34s %6s %6.0f %6.0f   (inputs %s, %s)\n", "ANFIS", "-", r.anfis.rmse[1], r.anfis.rmse[2],
              r.fy_inputs.c_str(), r.fz_inputs.c_str());
  std::printf("%-34s %6s %6d %6d\n", "  paper, Table 1", "-", 34, 21);
  std::printf("12 replications, as Table 2:\n");
  split("Fy", r.fy, v.process[1], v.sensor[1]);
  split("Fz", r.fz, v.process[2], v.sensor[2]);
  const TurningResult many = studyTurning(seed, v, 400);
  std::printf("400 replications:\n");
  split("Fy", many.fy, v.process[1], v.sensor[1]);
  split("Fz", many.fz, v.process[2], v.sensor[2]);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line("Accuracy of the estimators in random cases with known truth.");
  int count = 200;
  unsigned first = 1;
  StudyCase one;
  one.addTo(line, "--cases", count, "number of cases");
  line.option("--seed", first, "of the first case").showDefault();
  return runProgram(line, argc, argv, [&] {
    one.check(count);
    if (one.one()) return one.print(lineOf(first, one.number));
    machines(first, count);
    turning(first);
  });
}
