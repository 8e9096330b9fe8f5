// rosrun smartmill_studies kalman_spindle_sensor: Burzoni's sensor on the simulated machine, calibrated by
// the steps of the product, and its force compared with that of the table dynamometer.

#include <cmath>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "kalman/spindle_rig.h"
#include "smartmill_core/program.h"
#include "smartmill_core/testing/reference_case.h"
#include "smartmill_core/units.h"

namespace {

using namespace smartmill;
using kalman::SpindleRig;

constexpr double LENGTH = 0.139;  // [m] of tool and holder

struct Request {
  std::string model, out;
  std::uint64_t seed = 17;
  double bandwidth = 2500.0;
};

void calibrate(SpindleRig& rig, const Request& request) {
  rig.spin(0.0);
  rig.publishCondition(CuttingCondition::Kind::none);
  std::vector<double> weights;
  for (const int hung : {0, 1, 2, 3, 4, 5, 6, 7, 0}) weights.push_back(44.5 * hung);  // 10 lbs each
  std::fprintf(stderr, "weights at three lengths\n");
  rig.readStatic({0.100, 0.139, 0.180}, weights, false);
  kalman::CalibrationGoal fit;
  fit.step = kalman::CalibrationGoal::Step::fit;
  std::printf("%s\n", rig.ask(fit).message.c_str());
  std::fprintf(stderr, "tool against the workpiece\n");
  rig.readStatic({0.120}, {0.0, 100.0, 200.0, 300.0, 0.0}, true);
  kalman::CalibrationGoal verify;
  verify.step = kalman::CalibrationGoal::Step::verify;
  std::printf("at 120 mm, against the dynamometer: %s\n", rig.ask(verify).message.c_str());
  rig.world().setToolLength(LENGTH);
  rig.run(0.3);
  for (const char* direction : {"y", "x", "z"}) {
    const kalman::SensorResult tapped = rig.tap(direction, 9);
    std::printf("taps %s: %s", direction, tapped.message.c_str());
    for (const Mode& mode : tapped.modes.model.modes)
      std::printf("; %.0f Hz %.3f %.2f", mode.frequency, mode.damping_ratio, mode.gain);
    std::printf("; noise %.3f N\n", tapped.noise_rms);
  }
  const kalman::CalibrationResult found = rig.ask(fit);
  std::printf("%s\n\n", found.message.c_str());
  if (!request.out.empty()) kalman::writeSpindleSensor(*found.calibration, request.out);
}

void cuts(SpindleRig& rig, const MachineModel& model, double band) {
  std::printf(
      "slots 0.8 mm deep, 0.1 mm per tooth: RMS of the difference to the true force up to %.0f Hz, %% of "
      "it\n",
      band);
  std::printf("%6s %24s %24s %24s %24s\n", "rpm", "sensor, static", "sensor, compensated",
              "table dynamometer", "compensated to dynam.");
  for (const double rpm : {1000.0, 4500.0, 6000.0, 8400.0, 9000.0, 11600.0, 17600.0}) {
    const auto r = kalman::cutSlot(rig, model, units::radPerSecFromRpm(rpm), 0.8e-3, 0.1e-3, 1.0, 0.8);
    std::printf("%6.0f", rpm);
    const auto row = [&](const auto& found, const auto& truth) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t n = std::min(found[axis].size(), truth[axis].size());
        std::printf("%8.1f", 100.0 * bandError(found[axis], truth[axis], sim::World::SAMPLE_RATE, n / 10,
                                               n - n / 10, band));
      }
      std::printf(" ");
    };
    row(r.measured, r.truth);
    row(r.compensated, r.truth);
    row(r.dynamometer, r.truth);
    row(r.compensated, r.dynamometer);
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{"Spindle-integrated force sensor on the simulated machine (Burzoni ch. 3, 6.4)."};
  line.option("MODEL", request.model, "smartmill-model/1 of the simulated machine").required();
  line.option("-o,--out", request.out, "calibration file; empty: none");
  line.option("--seed", request.seed, "of noise and scatter").showDefault();
  line.option("--bandwidth-hz", request.bandwidth, "of the filter and of the errors").showDefault();
  return runProgram(line, argc, argv, [&] {
    const MachineModel model = readMachineModel(request.model);
    sim::WorldOptions world;
    world.seed = request.seed;
    world.spindle_sensor.present = true;
    kalman::CompensationParameters filter;
    filter.filter.bandwidth = request.bandwidth;
    kalman::TapParameters taps;
    taps.fit_high = request.bandwidth;
    SpindleRig rig(model, world, filter, taps, false);
    rig.sorted().forces().spindle().setLength(LENGTH);
    calibrate(rig, request);
    cuts(rig, model, request.bandwidth);
  });
}
