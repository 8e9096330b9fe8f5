// rosrun smartmill_kalman cutting_frf CAMPAIGN|BAG -o OUT: FRFs of the tool or of the force sensor from its
// cuts, as a function of the spindle's speed.

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "node/bag_cuts.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/modal/frf_files.h"
#include "smartmill_core/names.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"
#include "smartmill_kalman/in_cut/campaign_lines.h"

namespace {

using namespace smartmill;

constexpr std::array<const char*, 3> AXES{{"x", "y", "z"}};

struct Request {
  std::string campaign, out, model, of = "tool", response, spindle_sensor;
  double length = 0.139;     // [m]
  double force_error = 1.0;  // [%]
  bool identify = false, no_picture = false;
  kalman::CuttingFrfOptions options;
};

/// What stands for an axis in the campaign: its lines, and the tap at rest.
struct Axis {
  std::size_t axis = 0;
  std::vector<kalman::CuttingLine> lines;
  ModalModel rest;
  std::vector<kalman::SpeedFrf> found;
};

/// Sensors that show the force: of the model, or of the campaign's own taps.
std::array<ModalModel, 3> sensorsOf(const Campaign& campaign, const MachineModel& model,
                                    const Request& request) {
  return request.identify ? kalman::identifySensor(campaign, kalman::SensorFitParameters())
                          : model.force_sensor.axis;
}

Axis linesOf(const Campaign& campaign, const MachineModel& model, std::size_t axis,
             const std::array<ModalModel, 3>& sensors, const Request& request) {
  Axis found;
  found.axis = axis;
  const bool tool = request.of == "tool";
  found.rest = !tool ? sensors[axis] : axis == 0 ? model.tool_tip.x : model.tool_tip.y;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    std::fprintf(stderr, "%s: %s\n", AXES[axis], test.name.c_str());
    const Record record = readRecord(campaign, test, model);
    const kalman::CutStretch cut =
        tool ? kalman::toolStretch(record, test, axis, sensors[axis])
             : kalman::sensorStretch(record, test, axis, model, 0.01 * model.uncertainty.cutting);
    const auto lines = kalman::cuttingLines(cut, request.options);
    if (lines.empty())
      std::fprintf(stderr, "%s: no line of %s stands out (eleven revolutions are needed)\n",
                   test.name.c_str(), AXES[axis]);
    found.lines.insert(found.lines.end(), lines.begin(), lines.end());
  }
  return found;
}

/// Of a bag: what was recorded beside force/compensated, and its own taps.
std::vector<Axis> fromBag(const Request& request) {
  if (request.identify || !request.model.empty())
    throw Error("--identify and --model are for campaigns: a bag has its force/compensated and its taps");
  kalman::BagCutsRequest asked;
  asked.path = request.campaign;
  asked.tool = request.of == "tool";
  asked.response = !request.response.empty() ? request.response
                   : asked.tool              ? names::DISPLACEMENT
                                             : names::SPINDLE_FORCE;
  asked.spindle_sensor = request.spindle_sensor;
  asked.length = request.length;
  asked.force_error = 0.01 * request.force_error;
  const kalman::BagCuts cuts = kalman::cutsOfBag(asked);
  std::vector<Axis> axes;
  for (std::size_t a = 0; a < (asked.tool ? 2U : 3U); ++a) {
    Axis axis;
    axis.axis = a;
    axis.rest = cuts.rest[a];
    for (const kalman::CutStretch& cut : cuts.axis[a]) {
      const auto lines = kalman::cuttingLines(cut, request.options);
      if (lines.empty())
        std::fprintf(stderr, "%s: no line of %s stands out (eleven revolutions are needed)\n",
                     cut.name.c_str(), AXES[a]);
      axis.lines.insert(axis.lines.end(), lines.begin(), lines.end());
    }
    axes.push_back(std::move(axis));
  }
  return axes;
}

std::vector<Axis> axesOf(const Request& request) {
  if (std::filesystem::path(request.campaign).extension() == ".bag") return fromBag(request);
  if (!request.response.empty() || !request.spindle_sensor.empty())
    throw Error("--response and --spindle-sensor are for bags");
  const Campaign campaign = readCampaign(request.campaign);
  const MachineModel model = readMachineModel(request.model.empty() ? campaign.modelPath() : request.model);
  const std::array<ModalModel, 3> sensors = sensorsOf(campaign, model, request);
  std::vector<Axis> axes;
  for (std::size_t a = 0; a < (request.of == "tool" ? 2U : 3U); ++a)
    axes.push_back(linesOf(campaign, model, a, sensors, request));
  return axes;
}

/// The tap beside: what it shows at rest.
void tellRest(const Axis& axis, bool receptance) {
  for (const Mode& m : axis.rest.modes) {
    const double gain = receptance ? 1.0 / m.gain / units::N_PER_UM : m.gain;
    std::printf("%s, tap at rest: %9.2f +- %.2f Hz, damping %.5f +- %.5f, %s %.4g%s\n", AXES[axis.axis],
                m.frequency, m.frequency_std, m.damping_ratio, m.damping_ratio_std,
                receptance ? "stiffness" : "gain", gain, receptance ? " N/um" : "");
  }
}

std::string nameOf(const Axis& axis, const kalman::SpeedFrf& frf) {
  return formatted("_%s_%.0f", AXES[axis.axis], units::rpmFromRadPerSec(frf.speed));
}

void tell(const Axis& axis, const kalman::SpeedFrf& frf, bool receptance, CsvWriter& table) {
  const double rpm = units::rpmFromRadPerSec(frf.speed);
  std::printf("%s, %.0f rpm (%.0f..%.0f), %zu lines", AXES[axis.axis], rpm,
              units::rpmFromRadPerSec(frf.lowest), units::rpmFromRadPerSec(frf.highest), frf.frf.size());
  if (!frf.fit) {
    std::printf(": no modes are told: %s\n", frf.reason.c_str());
    return;
  }
  std::printf("\n");
  for (const Mode& m : frf.fit->model.modes) {
    const double gain = receptance ? 1.0 / m.gain / units::N_PER_UM : m.gain;
    const double gain_std = receptance ? gain * m.gain_std / m.gain : m.gain_std;
    std::printf("  %9.2f +- %.2f Hz, damping %.5f +- %.5f, %s %.4g +- %.2g%s\n", m.frequency, m.frequency_std,
                m.damping_ratio, m.damping_ratio_std, receptance ? "stiffness" : "gain", gain, gain_std,
                receptance ? " N/um" : "");
    table.row(AXES[axis.axis], rpm, m.frequency, m.frequency_std, m.damping_ratio, m.damping_ratio_std, gain,
              gain_std);
  }
}

/// Size over frequency at every speed, the tap at rest beside them.
void draw(const Axis& axis, const Request& request) {
  Gnuplot plot(request.out + "/frf_" + AXES[axis.axis] + ".png", 1100, 700);
  const bool tool = request.of == "tool";
  const double scale = tool ? 1.0 / units::UM : 1.0;
  plot << "set logscale y\nset grid\nset xlabel 'frequency [Hz]'\nset ylabel '"
       << (tool ? "size [um/N]" : "size [1]") << "'\nset title 'In the cut, " << AXES[axis.axis]
       << ", by speed of the spindle; black: at rest'\nset key right top\n";
  std::string curves;
  std::vector<std::vector<double>> rest;
  for (double f = request.options.low; f <= request.options.high; f += 5.0)
    rest.push_back({f, scale * std::abs(axis.rest.response(f))});
  const bool known = !axis.rest.modes.empty();
  if (known) plot.block("rest", rest);
  if (known) curves = "$rest with lines lw 2 lc rgb 'black' title 'at rest'";
  for (std::size_t i = 0; i < axis.found.size(); ++i) {
    const kalman::SpeedFrf& found = axis.found[i];
    std::vector<std::vector<double>> lines, fit;
    for (std::size_t k = 0; k < found.frf.size(); ++k)
      lines.push_back(
          {found.frf.frequency[k], scale * std::abs(found.frf.value[k]), scale * found.frf.std_dev[k]});
    for (const std::vector<double>& row : rest)
      if (found.fit) fit.push_back({row[0], scale * std::abs(found.fit->model.response(row[0]))});
    const std::string name = "s" + std::to_string(i), colour = " lc " + std::to_string(i + 1);
    plot.block(name, lines);
    curves += (curves.empty() ? "$" : ", $") + name + " with yerrorbars pt 7 ps 0.6" + colour + " title '" +
              formatted("%.0f rpm'", units::rpmFromRadPerSec(found.speed));
    if (fit.empty()) continue;
    plot.block(name + "f", fit);
    curves += ", $" + name + "f with lines" + colour + " notitle";
  }
  plot << "plot " << curves << "\n";
  plot.draw();
}

void run(const Request& request) {
  kalman::CuttingFrfOptions options = request.options;
  options.validate();
  const bool tool = request.of == "tool";
  const std::string unit = tool ? "m/N" : "1";
  options.unit_static_gain = !tool;
  std::filesystem::create_directories(request.out);
  CsvWriter table(
      std::string("axis,speed_rpm,frequency_hz,frequency_hz_std,damping_ratio,damping_ratio_std,") +
          (tool ? "stiffness_n_per_um,stiffness_n_per_um_std" : "gain,gain_std"),
      8);
  std::size_t told = 0;
  for (Axis& found : axesOf(request)) {
    if (found.lines.empty()) continue;
    tellRest(found, tool);
    found.found = kalman::cuttingFrfs(found.lines, unit, options);
    for (const kalman::SpeedFrf& frf : found.found) {
      tell(found, frf, tool, table);
      writeFrfCsv(frf.frf, request.out + "/frf" + nameOf(found, frf) + ".csv");
      if (!frf.fit) continue;
      ++told;
      writeModesYaml(estimateOf(frf.fit->model), unit, {"in the cut"},
                     request.out + "/modes" + nameOf(found, frf) + ".yaml");
    }
    if (!request.no_picture) draw(found, request);
  }
  table.save(request.out + "/modes.csv");
  if (told == 0)
    throw Error(request.campaign +
                ": no modes are told by its cuts at any speed; more lines come from runout, from "
                "more speeds (--speed-width-percent) and from longer records");
  std::printf("written: %s/frf_*.csv, modes_*.yaml, modes.csv%s\n", request.out.c_str(),
              request.no_picture ? "" : ", frf_*.png");
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  double width_percent = 100.0 * request.options.speed_width;
  CommandLine line{
      "FRF and modes from cuts, as a function of the spindle's speed: of the tool (displacement against the "
      "force sensor's force) or of the force sensor (against the force that the model's coefficients tell)."};
  line.option(
          "SOURCE", request.campaign,
          "campaign folder, or a bag: its steady cuts by force/compensated and spindle/angle, the taps at "
          "rest by its tool/modes")
      .required();
  line.option("-o,--out", request.out, "folder for frf_*.csv, modes_*.yaml, modes.csv and pictures")
      .required();
  line.option("--of", request.of, "what is identified").oneOf({"tool", "sensor"}).showDefault();
  line.option("--model", request.model, "model file (default: the campaign's)");
  line.option("--response", request.response,
              "of a bag: topic of what answers (default: tool daq/displacement, channels x, y; sensor "
              "daq/spindle_force)");
  line.option("--spindle-sensor", request.spindle_sensor,
              "of a bag: calibration of the six sensors in the spindle, where they answer");
  line.option("--spindle-sensor-length-m", request.length, "of tool and holder, for it").showDefault();
  line.option("--force-error-percent", request.force_error, "of a bag: deviation of force/compensated")
      .within(0.0, 50.0)
      .showDefault();
  line.flag("--identify", request.identify, "the force sensor as the campaign's own taps show it");
  line.option("--low-hz", request.options.low, "band of lines and fit").showDefault();
  line.option("--high-hz", request.options.high, "").showDefault();
  line.option("--speed-width-percent", width_percent, "cuts within this range of speed make one FRF")
      .within(0.0, 100.0)
      .showDefault();
  line.option("--part-s", request.options.part, "a record is cut into parts about so long").showDefault();
  line.option("--least-lines", request.options.least_lines, "with fewer nothing is told").showDefault();
  line.option("--max-modes", request.options.max_modes, "").showDefault();
  line.flag("--no-picture", request.no_picture, "");
  return runProgram(line, argc, argv, [&] {
    request.options.speed_width = 0.01 * width_percent;
    run(request);
  });
}
