#include "smartmill_kalman/commands.h"

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "commands/cutting_frf_results.h"
#include "recordings/bag_cuts.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/frf_files.h"
#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"
#include "smartmill_kalman/in_cut/cut_segments.h"
#include "smartmill_recording/recording_file.h"

namespace {

using namespace smartmill;

/// Sensors that show the force: of the model, or of the campaign's own taps.
std::array<ModalModel, 3> sensorsOf(const Campaign& campaign, const MachineModel& model,
                                    const kalman::CuttingFrfRequest& request) {
  return request.identify ? kalman::identifySensor(campaign, kalman::SensorFitParameters())
                          : model.force_sensor.axis;
}

kalman::CuttingFrfAxis linesOf(const Campaign& campaign, const MachineModel& model, std::size_t axis,
                               const std::array<ModalModel, 3>& sensors,
                               const kalman::CuttingFrfRequest& request) {
  kalman::CuttingFrfAxis found;
  found.axis = axis;
  const bool tool = request.of == "tool";
  found.rest = !tool ? sensors[axis] : axis == 0 ? model.tool_tip.x : model.tool_tip.y;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    std::fprintf(stderr, "%s: %s\n", AXIS_NAMES[axis], test.name.c_str());
    const Record record = readRecord(campaign, test, model);
    const kalman::CutSegment cut =
        tool ? kalman::toolSegment(record, test, axis, sensors[axis])
             : kalman::sensorSegment(record, test, axis, model, 0.01 * model.uncertainty.cutting);
    const auto lines = kalman::frfLines(cut, request.options);
    if (lines.empty())
      std::fprintf(stderr, "%s: no line of %s exceeds the noise (a part needs eleven revolutions)\n",
                   test.name.c_str(), AXIS_NAMES[axis]);
    found.lines.insert(found.lines.end(), lines.begin(), lines.end());
  }
  return found;
}

/// Lines of a bag: response over force/compensated, and the taps of the bag.
std::vector<kalman::CuttingFrfAxis> fromBag(const kalman::CuttingFrfRequest& request) {
  if (request.identify || !request.model.empty())
    throw Error("--identify, --model: expected a campaign; a bag contains force/compensated and taps");
  kalman::BagCutsRequest cuts_request;
  cuts_request.path = request.campaign;
  cuts_request.tool = request.of == "tool";
  cuts_request.response = !request.response.empty() ? request.response
                          : cuts_request.tool       ? names::DISPLACEMENT
                                                    : names::SPINDLE_FORCE;
  cuts_request.spindle_sensor = request.spindle_sensor;
  cuts_request.length = request.length;
  cuts_request.force_error = 0.01 * request.force_error;
  const kalman::BagCuts cuts = kalman::cutsOfBag(cuts_request);
  std::vector<kalman::CuttingFrfAxis> axes;
  for (std::size_t a = 0; a < (cuts_request.tool ? 2U : 3U); ++a) {
    kalman::CuttingFrfAxis axis;
    axis.axis = a;
    axis.rest = cuts.rest[a];
    for (const kalman::CutSegment& cut : cuts.axis[a]) {
      const auto lines = kalman::frfLines(cut, request.options);
      if (lines.empty())
        std::fprintf(stderr, "%s: no line of %s exceeds the noise (a part needs eleven revolutions)\n",
                     cut.name.c_str(), AXIS_NAMES[a]);
      axis.lines.insert(axis.lines.end(), lines.begin(), lines.end());
    }
    axes.push_back(std::move(axis));
  }
  return axes;
}

std::vector<kalman::CuttingFrfAxis> axesOf(const kalman::CuttingFrfRequest& request) {
  if (isRecording(request.campaign)) return fromBag(request);
  if (!request.response.empty() || !request.spindle_sensor.empty())
    throw Error("--response, --spindle-sensor: expected a bag");
  const Campaign campaign = readCampaign(request.campaign);
  const MachineModel model = readMachineModel(request.model.empty() ? campaign.modelPath() : request.model);
  const std::array<ModalModel, 3> sensors = sensorsOf(campaign, model, request);
  std::vector<kalman::CuttingFrfAxis> axes;
  for (std::size_t a = 0; a < (request.of == "tool" ? 2U : 3U); ++a)
    axes.push_back(linesOf(campaign, model, a, sensors, request));
  return axes;
}

void run(const kalman::CuttingFrfRequest& request) {
  kalman::CuttingFrfOptions options = request.options;
  options.speed_width = 0.01 * request.speed_width;
  options.validate();
  const bool tool = request.of == "tool";
  const std::string unit = tool ? "m/N" : "1";
  options.unit_static_gain = !tool;
  std::filesystem::create_directories(request.out);
  CsvWriter table(
      std::string("axis,speed_rpm,frequency_hz,frequency_hz_std,damping_ratio,damping_ratio_std,") +
          (tool ? "stiffness_n_per_um,stiffness_n_per_um_std" : "gain,gain_std"),
      8);
  std::size_t fits = 0;
  for (kalman::CuttingFrfAxis& found : axesOf(request)) {
    if (found.lines.empty()) continue;
    kalman::printRest(found, tool);
    found.found = kalman::cuttingFrfs(found.lines, unit, options);
    for (const kalman::SpeedFrf& frf : found.found) {
      kalman::printFrf(found, frf, tool, table);
      writeFrfCsv(frf.frf, request.out + "/frf" + kalman::suffixOf(found, frf) + ".csv");
      if (!frf.fit) continue;
      ++fits;
      writeModesYaml(estimateOf(frf.fit->model), unit, {"in the cut"},
                     request.out + "/modes" + kalman::suffixOf(found, frf) + ".yaml");
    }
    if (!request.no_picture) kalman::drawAxis(found, request);
  }
  table.save(request.out + "/modes.csv");
  if (fits == 0)
    throw Error(request.campaign +
                ": the cuts determine no mode at any speed; runout, more speeds (--speed-width-percent) and "
                "longer records give more lines");
  std::printf("written: %s/frf_*.csv, modes_*.yaml, modes.csv%s\n", request.out.c_str(),
              request.no_picture ? "" : ", frf_*.png");
}

}  // namespace

namespace smartmill::kalman {

Command cuttingFrfCommand() {
  Command command("cutting-frf", "identifies FRFs of the tool or the force sensor from cuts");
  command.description =
      "FRF and modes from cuts, as a function of spindle speed: of the tool (displacement against the force "
      "sensor's force) or of the force sensor (against the force predicted from the model's coefficients).";
  command.examples = {{"campaign -o frf", "the tool, by the campaign's cuts"},
                      {"session.bag --of sensor -o frf", "the force sensor, by a recorded session"}};
  command.files = {{"OUT/frf_*.csv", "FRF of an axis at a speed"},
                   {"OUT/modes_*.yaml", "its modes"},
                   {"OUT/modes.csv", "all modes"},
                   {"OUT/frf_*.png", "pictures, one per axis"}};
  command.setBody(run, [](CommandLine& line, CuttingFrfRequest& request) {
    line.option(
            "SOURCE", request.campaign,
            "campaign folder, or a bag: its steady cuts with force/compensated and spindle/angle, the taps "
            "at rest from its tool/modes")
        .required();
    line.option("-o,--out", request.out, "folder for frf_*.csv, modes_*.yaml, modes.csv and pictures")
        .required();
    line.option("--of", request.of, "what is identified").oneOf({"tool", "sensor"}).showDefault();
    line.option("--model", request.model, "model file (default: the campaign's)");
    line.option("--response", request.response,
                "bag: topic of the response (default: tool daq/displacement, channels x, y; sensor "
                "daq/spindle_force)");
    line.option("--spindle-sensor", request.spindle_sensor,
                "bag: calibration of the six sensors in the spindle, where they are the response");
    line.option("--spindle-sensor-length-m", request.length, "length of tool and holder [m], for it")
        .showDefault();
    line.option("--force-error-percent", request.force_error, "bag: standard deviation of force/compensated")
        .within(0.0, 50.0)
        .showDefault();
    line.flag("--identify", request.identify, "use the force sensor identified from the campaign's own taps");
    line.option("--low-hz", request.options.low, "lower end of the band of lines and fit").showDefault();
    line.option("--high-hz", request.options.high, "upper end of the band").showDefault();
    line.option("--speed-width-percent", request.speed_width, "cuts within this range of speed make one FRF")
        .within(0.0, 100.0)
        .showDefault();
    line.option("--part-s", request.options.part, "length of the parts into which a record is split [s]")
        .showDefault();
    line.option("--least-lines", request.options.least_lines, "least number of lines for a fit of modes")
        .showDefault();
    line.option("--max-modes", request.options.max_modes, "largest number of modes").showDefault();
    line.flag("--no-picture", request.no_picture, "no PNG");
  });
  return command;
}

}  // namespace smartmill::kalman
