#include "smartmill_loadmeter/commands.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/range.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/production.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

struct Options {
  std::string model, limits;
  std::vector<double> speeds, feeds, depths;
  double ktc = 0.0, kte = 0.0, torque = 0.0, power = 0.0, voltage_std = 3e-4, ktc_std = 0.0, kte_std = 0.0;
  double entry = 0.0, exit = 180.0;
  std::size_t max_cuts = 30;
};

struct Limit {
  double rpm, depth_mm;
};

/// Rows speed_rpm,axial_depth_mm with increasing speed; one header row.
std::vector<Limit> readLimits(const std::string& file) {
  const auto columns = readColumns(file, {"speed_rpm", "axial_depth_mm"});
  std::vector<Limit> limits;
  for (std::size_t i = 0; i < columns[0].size(); ++i) {
    const Limit l{columns[0][i], columns[1][i]};
    if (!(l.rpm > 0.0) || !(l.depth_mm >= 0.0) || (!limits.empty() && l.rpm <= limits.back().rpm))
      throw Error(file + ": speed_rpm " + shortNumber(l.rpm) +
                  ": expected increasing speeds, and depths of 0 or more");
    limits.push_back(l);
  }
  if (limits.size() < 2) throw Error(file + ": expected two speeds or more");
  return limits;
}

/// Smaller depth of the two neighbours; 0 outside.
double depthAt(const std::vector<Limit>& limits, double rpm) {
  for (std::size_t i = 1; i < limits.size(); ++i) {
    if (rpm >= limits[i - 1].rpm && rpm <= limits[i].rpm) {
      return units::MM * std::min(limits[i - 1].depth_mm, limits[i].depth_mm);
    }
  }
  return 0.0;
}

double required(const char* name, double given, const std::optional<double>& of_model,
                const std::string& file) {
  if (given > 0.0) return given;
  if (of_model) return *of_model;
  throw Error(file + ": spindle." + name + " is missing; add it or give the limit as an option");
}

void run(const Options& o) {
  const MachineModel model = readMachineModel(o.model);
  const Spindle& spindle = model.needSpindle("plan cuts");
  const ToolGeometry& tool = model.needTool("plan cuts");
  CandidateCuts candidates;
  for (const double rpm : o.speeds) candidates.speeds.push_back(units::radPerSecFromRpm(rpm));
  for (const double mm : o.feeds) candidates.feeds.push_back(mm * units::MM);
  for (const double mm : o.depths) candidates.axial_depths.push_back(mm * units::MM);
  candidates.entry = units::radFromDeg(o.entry);
  candidates.exit = units::radFromDeg(o.exit);
  CutLimits limits;
  limits.torque = required("rated_torque_nm", o.torque, spindle.rated_torque, o.model);
  limits.power = required("rated_power_w", o.power, spindle.rated_power, o.model);
  std::vector<Limit> depths;
  if (!o.limits.empty()) {
    depths = readLimits(o.limits);
    limits.stable_depth = [&](double speed, const Engagement&) {
      return depthAt(depths, units::rpmFromRadPerSec(speed));
    };
  }
  CuttingCoefficients expected;
  expected.ktc = o.ktc > 0.0 ? o.ktc * units::N_PER_MM2 : model.needCutting("expect torques").ktc;
  expected.kte = o.kte > 0.0 ? o.kte * units::N_PER_MM : model.needCutting("expect torques").kte;
  const TestPlan plan = planTests(tool, spindle, expected, candidates, limits, o.voltage_std,
                                  o.ktc_std * units::N_PER_MM2, o.kte_std * units::N_PER_MM, o.max_cuts);
  std::printf(
      "# Ktc +- %.2f N/mm2, Kte +- %.3f N/mm expected from %zu cuts, each with an air cut at its speed\n",
      plan.ktc_std / units::N_PER_MM2, plan.kte_std / units::N_PER_MM, plan.cuts.size());
  std::printf("speed_rpm,feed_per_tooth_mm,axial_depth_mm,torque_nm,power_w\n");
  for (const PlannedCut& cut : plan.cuts) {
    std::printf("%.1f,%.4f,%.3f,%.3f,%.1f\n", units::rpmFromRadPerSec(cut.speed),
                cut.engagement.feed_per_tooth / units::MM, cut.engagement.axial_depth / units::MM, cut.torque,
                cut.power);
  }
}

}  // namespace

namespace smartmill::loadmeter {

Command planCutsCommand() {
  Command command("plan-cuts", "plans the fewest test cuts for given standard deviations of Ktc and Kte");
  command.description =
      "The fewest test cuts that reach given standard deviations of Ktc and Kte within the limits.";
  command.examples = {
      {"mill.yaml --speeds 3000 6000 --feeds 0.05 0.1 0.2 --depths 0.5 1 --ktc-std 30 "
       "--kte-std 1",
       "chooses among twelve cuts"}};
  command.files = {{"STABLE", "CSV speed_rpm,axial_depth_mm with increasing speeds"}};
  command.setBody(run, [](CommandLine& line, Options& o) {
    line.option("MODEL", o.model, "model file: tool, spindle, and cutting unless --ktc and --kte").required();
    line.option("--speeds", o.speeds, "[rpm] to choose among").required().count(1, 100);
    line.option("--feeds", o.feeds, "[mm] per tooth to choose among").required().count(3, 100);
    line.option("--depths", o.depths, "[mm] axial, to choose among").required().count(1, 100);
    line.option("--entry", o.entry, "[deg] entry angle").showDefault();
    line.option("--exit", o.exit, "[deg] exit angle").showDefault();
    line.option("--ktc-std", o.ktc_std, "[N/mm2] standard deviation to reach").required().positive();
    line.option("--kte-std", o.kte_std, "[N/mm] standard deviation to reach").required().positive();
    line.option("--ktc", o.ktc, "[N/mm2] expected (default: the model's)");
    line.option("--kte", o.kte, "[N/mm] expected (default: the model's)");
    line.option("--voltage-std", o.voltage_std, "[V] standard deviation of a cut's mean reading")
        .showDefault();
    line.option("--torque", o.torque, "[Nm] limit of the mean torque (default: the model's rated torque)");
    line.option("--power", o.power, "[W] limit of the mean power (default: the model's rated power)");
    line.option("--stable", o.limits, "CSV speed_rpm,axial_depth_mm: largest stable depth");
    line.option("--most", o.max_cuts, "largest number of cuts").showDefault();
  });
  return command;
}

}  // namespace smartmill::loadmeter
