// rosrun smartmill_studies loadmeter_turning_cuts --model launch/models/lathe.yaml --cuts cuts.csv --currents
// currents.csv

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "loadmeter/turning_cuts.h"
#include "smartmill_core/program.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

/// Error and stated standard deviation of the estimates, and the largest error in standard deviations.
void report(const char* name, const std::vector<LatheCut>& cuts) {
  const std::array<const char*, 4> quantities{"Fx [N]", "Fy [N]", "Fz [N]", "torque [N m]"};
  std::printf("%s, %zu cuts%44s%12s%12s\n", name, cuts.size(), "RMSE", "stated", "largest / s");
  for (const bool joint : {false, true}) {
    for (std::size_t q = 0; q < 4; ++q) {
      double squares = 0.0, stated = 0.0, largest = 0.0, n = 0.0;
      for (const LatheCut& cut : cuts) {
        std::optional<Estimate> e;
        if (joint && cut.estimate) e = q < 3 ? cut.estimate->mean[q] : cut.estimate->torque;
        if (!joint && cut.motors) e = q < 3 ? cut.motors->force[q] : cut.motors->torque;
        if (!e) continue;
        const double error = e->value - (q < 3 ? cut.force[q] : cut.torque);
        squares += error * error, stated += e->std_dev * e->std_dev, n += 1.0;
        largest = std::max(largest, std::abs(error) / e->std_dev);
      }
      if (n > 0.0)
        std::printf("  %-16s %-14s %3.0f cuts %12.3f %11.3f %11.2f\n",
                    joint ? "force/estimate" : "motor currents", quantities[q], n, std::sqrt(squares / n),
                    std::sqrt(stated / n), largest);
    }
  }
}

struct Arguments {
  std::string model, cuts, currents, calibration;
  unsigned seed = 1;
};

void run(const Arguments& a) {
  const MachineModel model = readMachineModel(a.model);
  std::vector<LatheCut> all;
  std::optional<MotorCalibration> calibration;
  if (!a.calibration.empty()) calibration = readMotorCalibration(a.calibration);
  for (const char* method : {"regression", "anfis"}) {
    std::vector<LatheCut> cuts;
    for (const double speed : {45.0, 57.5, 75.0}) {
      const auto some =
          runLathe(latheTraits(speed, a.seed), standardPasses(), model, latheParameters(method), calibration);
      cuts.insert(cuts.end(), some.begin(), some.end());
    }
    if (calibration) report(method, cuts);
    all = cuts;
    if (!calibration) break;
  }
  if (!a.cuts.empty()) writeTables(all, a.cuts, a.currents);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Standard cuts of the simulated lathe: forces and motor currents as tables for calibrate "
      "--standard-cuts, and "
      "with a calibration the errors of the forces estimated from the currents.");
  Arguments a;
  line.option("--model", a.model, "machine model with a spindle").required();
  const auto cuts = line.option("--cuts", a.cuts, "table of forces to write");
  const auto currents = line.option("--currents", a.currents, "table of currents to write");
  cuts.needs(currents);
  currents.needs(cuts);
  line.option("--calibration", a.calibration, "calibration of the motors (smartmill-motor-calibration/1)");
  line.option("--seed", a.seed, "of the noise").showDefault();
  return runProgram(line, argc, argv, [&] { run(a); });
}
