#include "smartmill_stability/commands.h"

#include <cmath>
#include <cstdio>
#include <string>

#include "recordings/bag_charts.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/parameters/parameter_options.h"
#include "smartmill_core/units.h"
#include "smartmill_recording/reading_progress.h"
#include "smartmill_stability/chart/picture.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

struct Options {
  std::string bag, model, output, states, bistable;
  NodeParameters parameters;
};

constexpr int DIGITS = 17;  // every digit of the values that the node publishes

void write(const StabilityChart& chart, const std::string& file) {
  CsvWriter csv("rpm,limit_mm,chatter_hz,torque_limit_mm,power_limit_mm", DIGITS);
  for (std::size_t i = 0; i < chart.limit.depth.size(); ++i) {
    csv.row(units::rpmFromRadPerSec(chart.limit.spindle_speed[i]), chart.limit.depth[i] / units::MM,
            chart.limit.chatter_frequency[i], chart.torque_depth_limit[i] / units::MM,
            chart.power_depth_limit[i] / units::MM);
  }
  csv.save(file);
  drawPicture(file,
              "set xlabel 'Spindle speed [rpm]'\nset ylabel 'Axial depth [mm]'\nset yrange [0:]\n"
              "plot %FILE skip 1 using 1:2 with lines lw 2 title 'stability limit', "
              "%FILE skip 1 using 1:4 with lines title 'torque limit', "
              "%FILE skip 1 using 1:5 with lines title 'power limit'");
}

void write(const std::vector<ChatterState>& states, const std::string& file) {
  CsvWriter csv("time_s,condition,valid,chatter,frequency_hz,energy_ratio,severity_n", DIGITS);
  for (const ChatterState& s : states)
    csv.row(s.stamp, s.condition, s.valid, s.chatter, s.frequency, s.energy_ratio, s.severity);
  csv.save(file);
}

/// Limits of small and large vibrations for the force curve.
void write(const BistableChart& chart, const std::string& file) {
  CsvWriter csv("rpm,limit_mm,large_limit_mm,secant_limit_mm", DIGITS);
  for (const BistableLimit& b : chart.limits)
    csv.row(units::rpmFromRadPerSec(b.speed), b.small.depth / units::MM, b.large.depth / units::MM,
            b.secant.depth / units::MM);
  csv.save(file);
  drawPicture(file,
              "set xlabel 'Spindle speed [rpm]'\nset ylabel 'Axial depth [mm]'\nset yrange [0:]\n"
              "plot %FILE skip 1 using 1:3:2 with filledcurves lc 'gold' title 'bistable', "
              "%FILE skip 1 using 1:2 with lines lw 2 lc 'black' title 'limit of small vibrations', "
              "%FILE skip 1 using 1:3 with lines lw 2 lc 'red' title 'limit of large vibrations'");
}

void print(const char* title, const std::vector<StabilityPoint>& points) {
  std::printf("%s\n", title);
  for (const StabilityPoint& p : points) {
    std::printf("  %8.1f rpm %8.4f mm (limit %8.4f mm, %7.1f Hz) %7.2f Nm %7.3f kW %8.2f cm3/min\n",
                units::rpmFromRadPerSec(p.spindle_speed), p.axial_depth / units::MM,
                p.depth_limit / units::MM, p.chatter_frequency, p.torque, p.power / 1e3,
                p.material_removal_rate * 60e6);
  }
}

void run(const Options& o) {
  NodeParameters parameters = o.parameters;
  if (!o.model.empty()) parameters.model = o.model;
  parameters.validate();
  if (parameters.model.empty())
    throw Error(o.bag + ": machine model missing: expected --model or the parameter model");
  const BagCharts found =
      chartsFromBag(o.bag, readMachineModel(parameters.model), parameters, printReadingProgress);
  if (!o.states.empty()) write(found.states, o.states);
  if (found.bistable) {
    std::printf(
        "force curve at feed per tooth %.4f mm (mean chip thickness %.4f mm): tangential slope %.1f N/mm2\n",
        found.bistable->feed / units::MM, found.bistable->mean_chip / units::MM,
        found.bistable->slope / units::N_PER_MM2);
    if (!o.bistable.empty()) write(*found.bistable, o.bistable);
  } else if (!o.bistable.empty()) {
    throw Error(
        o.bag +
        ": no limits for a force curve: expected material/force_curve (or the parameter force_curve), "
        "modes of x and y, and coefficients");
  }
  int valid = 0, chatter = 0;
  for (const ChatterState& s : found.states) {
    valid += s.valid;
    chatter += s.chatter;
  }
  std::printf("chatter in %d of %d windows of steady cutting\n", chatter, valid);
  if (!found.chart) {
    if (!o.output.empty()) throw Error(o.bag + ": no chart, missing: " + found.missing);
    std::printf("no chart, missing: %s\n", found.missing.c_str());
    return;
  }
  std::printf("tool %s, material %s, stable at every speed below %.4f mm\n", found.chart->tool.c_str(),
              found.chart->material.c_str(), found.chart->absolute_depth_limit / units::MM);
  std::printf("limits by %s\n", found.solver.c_str());
  print("recommended:", found.chart->recommended);
  print("unstable, proposed for a check:", found.chart->unstable);
  if (!o.output.empty()) write(*found.chart, o.output);
}

}  // namespace

namespace smartmill::stability {

Command chartCommand() {
  Command command("chart", "computes the stability chart of a recorded session");
  command.description =
      "Stability chart and chatter verdicts of a recorded bag, as computed by stability_node.";
  command.examples = {
      {"session.bag --model mill.yaml -o chart.csv", "the chart, a picture, recommended points"},
      {"session.bag --model mill.yaml --states states.csv", "the chatter verdicts over time"}};
  command.files = {
      {"OUT",
       "CSV rpm,limit_mm,chatter_hz,torque_limit_mm,power_limit_mm; a picture of the same name with "
       ".png"},
      {"launch/config/stability.yaml", "the node's parameters, for --params"}};
  command.setBody(run, [](CommandLine& line, Options& o) {
    line.option("BAG", o.bag, "recording with tool/frf, material/coefficients and cuts").required();
    line.option("--model", o.model, "machine model file: tool and spindle limits (default: parameter model)");
    line.option("-o,--out", o.output, "CSV of the chart; a picture of the same name with .png");
    line.option(
        "--bistable", o.bistable,
        "CSV of the limits of small and large vibrations for the force curve; a picture of the same name "
        "with .png");
    line.option("--states", o.states, "CSV of the chatter verdicts");
    const ParameterOptions parameters(line, tableOf(o.parameters), "launch/config/stability.yaml");
  });
  return command;
}

}  // namespace smartmill::stability
