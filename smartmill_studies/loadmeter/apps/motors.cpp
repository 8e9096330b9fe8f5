// rosrun smartmill_studies loadmeter_motors --cuts 60 --seed 1

#include <unistd.h>

#include <cstdio>

#include "loadmeter/motor_days.h"
#include "smartmill_core/program.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

std::vector<MotorCut> day(const char* name, const MotorDay& one,
                          const std::optional<MotorCalibration>& calibration) {
  const auto cuts = runDay(one, calibration, [&](double share) {
    if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\r%s: %3.0f %%", name, 100.0 * share);
  });
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\n");
  return cuts;
}

/// Along X or Y only, where the cutting force always opposes the feed.
MotorDay standardDay(unsigned seed, int cuts) {
  MotorDay one{20.0, seed, cuts};
  one.diagonal = false;
  return one;
}

void row(const char* name, const std::array<double, 3>& e) {
  std::printf("  %-44s %7.1f %7.1f %7.1f\n", name, e[0], e[1], e[2]);
}

void variation(const DayErrors::Variation& v) {
  row("  variation, RMSE X, Y, Z [N]", v.error);
  row("  its stated deviation, root mean square [N]", v.stated);
  std::printf("  %-44s %6.1f%% %6.1f%% %6.1f%%\n", "  within 0.674 std (50 %)", 100 * v.half[0],
              100 * v.half[1], 100 * v.half[2]);
}

void report(const char* name, const DayErrors& e) {
  std::printf("%s (%d, %d, %d cuts)\n", name, e.count[0], e.count[1], e.count[2]);
  row("regression, RMSE X, Y, tangential [N]", e.regression);
  row("ANFIS", e.anfis);
  row("regression, air cuts of the first day", e.old_air);
  row("one estimator, RMSE X, Y, Z [N]", e.estimate);
  std::printf("  %-44s %6.1f%% %6.1f%% %6.1f%%\n", "  within 1.96 std: static", 100 * e.inside[0],
              100 * e.inside[1], 100 * e.inside[2]);
  std::printf("  %-44s %6.1f%% %6.1f%% %6.1f%%\n", "  within 1.96 std: dynamic", 100 * e.inside_rms[0],
              100 * e.inside_rms[1], 100 * e.inside_rms[2]);
  variation(e.variation);
  std::printf("  %d windows of 0.5 s, ten a second while a cut is steady\n", e.windows);
  row("  RMSE X, Y, Z [N]", e.window);
  std::printf("  %-44s %6.1f%% %6.1f%% %6.1f%%\n", "  within 1.96 std: static", 100 * e.inside_window[0],
              100 * e.inside_window[1], 100 * e.inside_window[2]);
  std::printf("  %-44s %6.1f%% %6.1f%% %6.1f%%\n", "  within 1.96 std: dynamic", 100 * e.inside_window_rms[0],
              100 * e.inside_window_rms[1], 100 * e.inside_window_rms[2]);
  variation(e.variation_window);
}

void run(int cuts, unsigned seed, double warmer, const std::string& out) {
  const auto standard = day("standard cuts", standardDay(seed, cuts), std::nullopt);
  const MotorCalibration calibration = calibrationOf(standard);
  if (!out.empty()) writeMotorCalibration(calibration, out);
  for (std::size_t a = 0; a < 2; ++a)
    std::printf("drive %c: %.1f +- %.1f N/A (true 200.0), scatter %.1f N\n", "XY"[a],
                calibration.drive[a]->newton_per_ampere.value,
                calibration.drive[a]->newton_per_ampere.std_dev, calibration.drive[a]->scatter);
  std::printf("spindle: scatter %.3f N m\n", calibration.spindle->scatter());
  report("the same day, other cuts",
         judgeDay(standard, calibration, day("same day", {20.0, seed + 1, cuts}, calibration)));
  const std::string name = "another day, " + std::to_string(static_cast<int>(warmer)) + " K warmer";
  report(name.c_str(),
         judgeDay(standard, calibration, day("another day", {20.0 + warmer, seed + 2, cuts}, calibration)));
  MotorDay no_lines{20.0 + warmer, seed + 2, cuts};
  no_lines.rapid_moves = false;
  report((name + ", lags unknown: no lines").c_str(),
         judgeDay(standard, calibration, day("no lines", no_lines, calibration)));
  MotorDay with_sensor{20.0 + warmer, seed + 2, cuts};
  with_sensor.force_sensor = true;
  report((name + ", with a force sensor").c_str(),
         judgeDay(standard, calibration, day("with sensor", with_sensor, calibration)));
  std::printf(
      "Cheng & Venuvinod, Table 1, turning centre: regression Fx 29, Fy (tangential) 36, Fz 27 N; ANFIS Fy "
      "34, Fz "
      "21 N\n");
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Forces from motor currents of the simulated machine: regression and ANFIS trained on one day and "
      "tested on a day with another temperature, and the estimator of all sensors.");
  int cuts = 60;
  unsigned seed = 1;
  double warmer = 15.0;
  std::string out;
  line.option("--cuts", cuts, "cuts per day").showDefault().within(24, 10000);
  line.option("--seed", seed, "of the first day").showDefault();
  line.option("--warmer", warmer, "temperature difference of the other day [K]").showDefault();
  line.option("-o", out, "calibration file for loadmeter_node (motor_calibration)");
  return runProgram(line, argc, argv, [&] { run(cuts, seed, warmer, out); });
}
