#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"
#include "smartmill_loadmeter/motor/motor_calibration.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

void run(const std::string& path, const std::string& model_file) {
  const Campaign campaign = readCampaign(path);
  const MachineModel model = readMachineModel(model_file.empty() ? campaign.modelPath() : model_file);
  const Spindle& spindle = model.needSpindle("calibrate the load meter");
  std::vector<AirCut> air;
  std::vector<TimedAirCut> timed;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::air) continue;
    const Record record = readRecord(campaign, test);
    if (!record.has("load_meter")) continue;
    const MeanVoltage v =
        meanVoltage(record.column("load_meter"), 1.0 / test.sample_rate,
                    timeConstant(spindle.load_meter_bandwidth), spindle.load_meter_resolution);
    air.push_back({test.spindle_speed, v.mean, v.std_dev});
    timed.push_back({air.back(), test.start_time.value_or(0.0)});
  }
  const IdleVoltage idle = fitIdleVoltage(air, spindle.friction_zero_below, spindle.load_meter_resolution);
  std::printf(
      "air cuts, as the thesis (eq. 3.6..3.8):\n  Kb   %.4e +- %.1e V s2/rad2\n  KTcf %.4e +- %.1e V s/rad\n",
      idle.kb.value, idle.kb.std_dev, idle.ktcf.value, idle.ktcf.std_dev);
  std::printf("friction laws, best first:\n");
  for (const FittedFriction& f :
       fitFrictionLaws(timed, spindle.load_meter_gain, spindle.friction_zero_below)) {
    std::printf("  BIC %9.1f, RMS %.2e Nm: %s: %.4e Nm s/rad, %.4f Nm", f.bic, f.rms, f.shape.name().c_str(),
                f.law.viscous, f.law.coulomb);
    if (f.shape.stribeck) {
      std::printf(", breakaway %.4f Nm to %.0f rpm", f.law.breakaway,
                  units::rpmFromRadPerSec(f.law.stribeck_speed));
    }
    if (f.shape.warmup) std::printf(", cold +%.1f %%, %.0f s", 100.0 * f.law.cold_ratio, f.law.warmup_time);
    std::printf("\n");
  }
  // The force records tell the torque of every cut, the transients of the load meter its bandwidth.
  const IdentifiedCoefficients force = identifyFromForceRecords(campaign, model, Means::revolutions);
  MachineModel free_lag = model;
  free_lag.uncertainty.spindle = 50.0;
  LoadRecordOptions options;
  options.spindle_uncertainty = true;
  const LoadRecordResult load = identifyFromLoadRecords(campaign, free_lag, options);
  for (const std::string& note : load.notes) std::fprintf(stderr, "calibrate: %s\n", note.c_str());
  const double ratio = load.set.value.ktc / force.value.ktc;
  const double share = std::hypot(force.std_dev.ktc / force.value.ktc, load.disagreement);
  const double gain = spindle.load_meter_gain * ratio;
  std::printf("torque of %d cuts from their forces:\n", force.tests);
  std::printf("  load_meter_v_per_w      %.5e +- %.1e (model: %.5e)\n", gain, gain * share,
              spindle.load_meter_gain);
  std::printf("  load_meter_bandwidth_hz %.4f (model: %.4f)\n", load.bandwidth, spindle.load_meter_bandwidth);
  std::printf("  viscous_nm_s_per_rad    %.4e\n  coulomb_nm              %.4f\n",
              load.friction.viscous / ratio, load.friction.coulomb / ratio);
}

void runMotors(const std::string& standard, const std::string& currents, double base_speed_rpm,
               const std::string& output) {
  const MotorCalibration c = calibrateMotors(readStandardCuts(standard), readMachineCurrents(currents),
                                             units::radPerSecFromRpm(base_speed_rpm));
  for (const std::string& note : c.notes) std::fprintf(stderr, "calibrate: %s\n", note.c_str());
  const std::array<const char*, 3> names{"X", "Y", "Z"};
  for (std::size_t a = 0; a < 3; ++a) {
    if (!c.drive[a]) {
      std::printf("drive %s: not calibrated, it moves in no standard cut\n", names[a]);
      continue;
    }
    const DriveCalibration& d = *c.drive[a];
    std::printf("drive %s: %.2f +- %.2f N/A, scatter of a cut %.1f N, from %d cuts\n", names[a],
                d.newton_per_ampere.value, d.newton_per_ampere.std_dev, d.scatter, d.cuts);
  }
  if (c.spindle) {
    std::printf("spindle: T = a(N) dI^b(N), base speed %.0f rpm, scatter of a cut %.3f Nm, R2 %.4f\n",
                c.spindle->baseSpeed(), c.spindle->scatter(), c.spindle->rSquared());
  }
  if (!output.empty()) writeMotorCalibration(c, output);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Friction, load-meter constant and bandwidth of a machine from a campaign's air cuts and from cuts "
      "whose "
      "forces a dynamometer recorded; or feed drives and spindle from standard cuts and motor currents.");
  std::string path, model;
  std::string standard, currents, output;
  double base_speed = 1e9;
  const auto campaign = line.option("CAMPAIGN", path, "campaign folder");
  const auto cuts = line.option("--standard-cuts", standard,
                                "CSV of standard cuts whose forces a remote dynamometer recorded: "
                                "cut,force_x[N],force_y[N],force_z[N],torque[N m]");
  const auto own =
      line.option("--currents", currents,
                  "CSV of this machine's current ranges in the same cuts and in air: "
                  "cut,spindle_speed[rpm],current_x[A],air_x[A],..,current_spindle[A],air_spindle[A]");
  cuts.needs(own).excludes(campaign);
  own.needs(cuts);
  line.option("--base-speed", base_speed, "of the spindle motor in rpm (default: below it throughout)")
      .positive()
      .needs(cuts);
  line.option("-o,--output", output, "motor calibration for the node (parameter motor_calibration)")
      .needs(cuts);
  line.option("--model", model, "model file (default: the campaign's)");
  return runProgram(line, argc, argv, [&] {
    if (path.empty() && standard.empty())
      throw UsageError("CAMPAIGN, or --standard-cuts and --currents, is required");
    if (!standard.empty()) {
      runMotors(standard, currents, base_speed, output);
    } else {
      run(path, model);
    }
  });
}
