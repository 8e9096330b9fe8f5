#include "smartmill_loadmeter/commands.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"
#include "smartmill_loadmeter/motor/motor_calibration.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

struct Arguments {
  std::string program, campaign, model, standard, currents, output;
  double base_speed = 1e9;  // [rpm]
};

void printNotes(const Arguments& a, const std::vector<std::string>& notes) {
  for (const std::string& note : notes) std::fprintf(stderr, "%s: %s\n", a.program.c_str(), note.c_str());
}

void runCampaign(const Arguments& a) {
  const Campaign campaign = readCampaign(a.campaign);
  const MachineModel model = readMachineModel(a.model.empty() ? campaign.modelPath() : a.model);
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
      "air cuts (Dunwoody eq. 3.6..3.8):\n  Kb   %.4e +- %.1e V s2/rad2\n  KTcf %.4e +- %.1e V s/rad\n",
      idle.kb.value, idle.kb.std_dev, idle.ktcf.value, idle.ktcf.std_dev);
  std::printf("friction laws, best first:\n");
  for (const FittedFriction& f :
       fitFrictionLaws(timed, spindle.load_meter_gain, spindle.friction_zero_below)) {
    std::printf("  BIC %9.1f, RMS %.2e Nm: %s: %.4e Nm s/rad, %.4f Nm", f.bic, f.rms, f.terms.name().c_str(),
                f.law.viscous, f.law.coulomb);
    if (f.terms.stribeck) {
      std::printf(", breakaway %.4f Nm to %.0f rpm", f.law.breakaway,
                  units::rpmFromRadPerSec(f.law.stribeck_speed));
    }
    if (f.terms.warmup) std::printf(", cold +%.1f %%, %.0f s", 100.0 * f.law.cold_ratio, f.law.warmup_time);
    std::printf("\n");
  }
  // The force records determine the torque of every cut, the transients of the load meter its bandwidth.
  const IdentifiedCoefficients force = identifyFromForceRecords(campaign, model, Means::revolutions);
  MachineModel free_lag = model;
  free_lag.uncertainty.spindle = 50.0;
  LoadRecordOptions options;
  options.spindle_uncertainty = true;
  const LoadRecordResult load = identifyFromLoadRecords(campaign, free_lag, options);
  printNotes(a, load.notes);
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

void runMotors(const Arguments& arguments) {
  const MotorCalibration c =
      calibrateMotors(readStandardCuts(arguments.standard), readMachineCurrents(arguments.currents),
                      units::radPerSecFromRpm(arguments.base_speed));
  printNotes(arguments, c.notes);
  const std::array<const char*, 3> names{"X", "Y", "Z"};
  for (std::size_t a = 0; a < 3; ++a) {
    if (!c.drive[a]) {
      std::printf("drive %s: not calibrated, fewer than three standard cuts with motion\n", names[a]);
      continue;
    }
    const DriveCalibration& d = *c.drive[a];
    std::printf("drive %s: %.2f +- %.2f N/A, scatter of a cut %.1f N, from %d cuts\n", names[a],
                d.newton_per_ampere.value, d.newton_per_ampere.std_dev, d.scatter, d.cuts);
    if (d.anfis) std::printf("  ANFIS: RMS of the cuts %.1f N\n", d.anfis->trainingRms());
  }
  if (c.spindle) {
    std::printf("spindle: T = a(N) dI^b(N), base speed %.0f rpm, scatter of a cut %.3f Nm, R2 %.4f\n",
                c.spindle->baseSpeed(), c.spindle->scatter(), c.spindle->rSquared());
    if (c.spindle_anfis) std::printf("  ANFIS: RMS of the cuts %.3f Nm\n", c.spindle_anfis->trainingRms());
  }
  if (!arguments.output.empty()) writeMotorCalibration(c, arguments.output);
}

void run(const Arguments& a) {
  if (a.campaign.empty() && a.standard.empty())
    throw UsageError("CAMPAIGN, or --standard-cuts and --currents, is required");
  if (!a.standard.empty()) {
    runMotors(a);
  } else {
    runCampaign(a);
  }
}

}  // namespace

namespace smartmill::loadmeter {

Command calibrateCommand() {
  Command command("calibrate", "calibrates friction, load meter and motor currents of a machine");
  command.description =
      "Friction, load-meter constant and bandwidth of a machine from a campaign's air cuts and from cuts "
      "whose "
      "forces a dynamometer recorded; or feed drives and spindle from standard cuts and motor currents.";
  command.examples = {{"campaigns/none", "friction laws and the load meter from a campaign"},
                      {"--standard-cuts cuts.csv --currents machine.csv -o motors.yaml",
                       "drives and spindle from motor currents"}};
  command.files = {{"OUT", "motor calibration, for the node's parameter motor_calibration"}};
  command.setBody(run, [](CommandLine& line, Arguments& a) {
    a.program = line.program();
    const auto campaign = line.option("CAMPAIGN", a.campaign, "campaign folder");
    const auto cuts = line.option("--standard-cuts", a.standard,
                                  "CSV of standard cuts whose forces a remote dynamometer recorded: "
                                  "cut,force_x[N],force_y[N],force_z[N],torque[N m]");
    const auto own =
        line.option("--currents", a.currents,
                    "CSV of this machine's current ranges in the same cuts and in air: "
                    "cut,spindle_speed[rpm],current_x[A],air_x[A],..,current_spindle[A],air_spindle[A]");
    cuts.needs(own).excludes(campaign);
    own.needs(cuts);
    line.option("--base-speed", a.base_speed,
                "base speed of the spindle motor [rpm] (default: all cuts are below it)")
        .positive()
        .needs(cuts);
    line.option("-o,--output", a.output, "motor calibration for the node (parameter motor_calibration)")
        .needs(cuts);
    line.option("--model", a.model, "model file (default: the campaign's)");
  });
  return command;
}

}  // namespace smartmill::loadmeter
